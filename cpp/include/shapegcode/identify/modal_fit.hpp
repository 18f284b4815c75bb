#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/identify/arma.hpp"

namespace shapegcode {

/// Course of the force between its samples.
enum class ForceHold : std::uint8_t {
  linear,        ///< straight from sample to sample
  band_limited,  ///< as after an anti-aliasing filter: sinc interpolation, accurate up to 0.45 of the sampling rate
  impulse,  ///< impulses at the samples, each just before the response is sampled: force times period is the momentum
};

/// Parts of the model of an impact besides its modes.
struct ModalFitOptions {
  Quantity quantity = Quantity::acceleration;
  /// A constant offset of the response per record.
  bool with_offset = true;
  /// Modes far below: the structure moves like a free mass, displacement = double integral of the force / mass.
  bool with_mass_line = false;
  /// Modes far above: a spring without mass, displacement = compliance * force (acceleration: the force's second
  /// difference).
  bool with_compliance = false;
  /// Intervals that hold for residuals correlated over time as well (stationary noise of any colour).
  bool coloured_residuals = false;
  ForceHold hold = ForceHold::linear;
  /// Standard deviation in N of white noise on the measured force. In a pulse of up to 128 samples the true force is
  /// estimated together with the modes; the effect on a longer pulse is added to the covariance, to first order.
  double force_noise_n = 0.0;
  int most_iterations = 60;
};

/// Figures that every fit has.
struct FitQuality {
  double sum_of_squares = 0.0;            ///< of the residuals, in the response's unit squared
  double log_likelihood = 0.0;            ///< for white normal residuals of the same variance in all records
  std::size_t samples = 0;                ///< of all records together
  std::size_t parameters = 0;             ///< fitted ones, including offsets and amplitudes
  double residual_autocorrelation = 0.0;  ///< at a lag of one sample, no unit; white noise: about 0
  std::vector<double> residual_rms;       ///< per record, in the response's unit
  std::vector<Eigen::VectorXd> fitted;    ///< per record: the model's response, including the offset
  int iterations = 0;
  bool converged = false;
  std::string reason;  ///< why it has not converged; empty if it has
};

/// Result of fit_modes. Entry r belongs to the r-th start; modes may have changed their order.
struct ModalFit {
  std::vector<double> omega_rad_s;    ///< undamped natural frequencies
  std::vector<double> damping_ratio;  ///< no unit
  std::vector<double> inverse_mass;   ///< residues 1/m in 1/kg, negative: opposite mode signs at impact and sensor
  Eigen::MatrixXd covariance;         ///< (3n, 3n) of omega, zeta, 1/m of the first mode, then of the second, ...
  double mass_line = 0.0;             ///< 1/kg, 0 without it
  double compliance = 0.0;            ///< m/N, 0 without it
  std::vector<double> offset;         ///< per record, in the response's unit
  FitQuality quality;
};

/// Fits modes to impacts by output error: least squares of measured minus modelled response (maximum likelihood for
/// white noise on the response). The model is the sum over modes of (1/m) s^q/(s^2 + 2 zeta omega s + omega^2) applied
/// to the measured force (q = 0 displacement, 1 velocity, 2 acceleration), from rest at the first sample; between its
/// samples the force follows `hold`, and the modes are propagated exactly.
///
/// `start`: n >= 1 modes (rad/s, below Nyquist; 0 < zeta < 1), e.g. from arma_driven. The fit is Levenberg-Marquardt in
/// ln omega and ln zeta with exact derivatives; 1/m and the parameters of the options are linear and eliminated
/// (variable projection). The covariance is the residual variance over (J'J), with degrees of freedom = samples -
/// parameters; noise on the force adds its effect on the modelled response, to first order.
///
/// Throws Error(argument) on signals that arma_driven refuses, a period or start outside its range, or too few samples
/// for the parameters. The result reports whether it converged. Source: L. Ljung, System Identification, ch. 7.
[[nodiscard]] ModalFit fit_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& start,
                                 const ModalFitOptions& options);

/// Response of given modes to a force, in the unit of `quantity`: the model of fit_modes. Throws Error(argument) on
/// unequal numbers of parameters, or a value outside its range or not finite.
[[nodiscard]] Eigen::VectorXd modal_response(std::span<const double> force_n, double period_s,
                                             const NaturalModes& modes, std::span<const double> inverse_mass,
                                             Quantity quantity, ForceHold hold = ForceHold::linear);

struct DecayFitOptions {
  /// A constant offset per record.
  bool with_offset = true;
  /// Intervals that hold for residuals correlated over time as well (stationary noise of any colour).
  bool coloured_residuals = false;
  int most_iterations = 60;
};

/// Result of fit_decay. Entry r belongs to the r-th start.
struct DecayFit {
  std::vector<double> omega_rad_s;    ///< undamped natural frequencies
  std::vector<double> damping_ratio;  ///< no unit
  Eigen::MatrixXd covariance;         ///< (2n, 2n) of omega, zeta of the first mode, then of the second, ...
  Eigen::MatrixXd amplitude;          ///< (records, n) at the first sample, in the response's unit
  Eigen::MatrixXd phase_rad;          ///< (records, n)
  std::vector<double> offset;         ///< per record, in the response's unit
  FitQuality quality;
};

/// Fits free decays: response = sum over modes of A exp(-zeta omega t) cos(omega_d t + phase), plus an offset, t from
/// the first sample, by least squares (for white noise the maximum likelihood). omega and zeta are common to the
/// records, amplitude and phase are separate for each record. The measured quantity (displacement, velocity or
/// acceleration) makes no difference.
///
/// `start`: n >= 1 modes (rad/s, below Nyquist; 0 < zeta < 1), e.g. from arma_decay. Method and errors as in fit_modes.
[[nodiscard]] DecayFit fit_decay(Responses responses, double period_s, const NaturalModes& start,
                                 const DecayFitOptions& options);

/// Candidates in the order in which each explains most of the remaining residual.
struct ModeRanking {
  std::vector<std::size_t> chosen;     ///< indices into the candidates
  std::vector<double> sum_of_squares;  ///< of the residual after each choice, in the response's unit squared
  double total = 0.0;                  ///< of the responses, without offsets
};

/// Ranks candidates for the modes of impacts by forward selection: each step chooses the candidate that, together with
/// those already chosen, gives the smallest sum of squares; residues are fitted, frequencies and damping ratios are
/// not. Provides starts for fit_modes from the poles of a stabilisation chart, even if the model with the same number
/// of modes misses a weak one. Stops early if no candidate explains more.
///
/// `candidates` as the starts of fit_modes; `most` >= 1: number to choose. The first `kept` of them (modes already
/// fitted) are chosen before all others, in their order, so that the others explain only the remaining residual. Throws
/// Error(argument) as fit_modes.
[[nodiscard]] ModeRanking rank_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& candidates,
                                     std::size_t most, std::size_t kept = 0,
                                     Quantity quantity = Quantity::acceleration);

/// The same for free decays: amplitude and phase are separate for each record.
[[nodiscard]] ModeRanking rank_modes(Responses responses, double period_s, const NaturalModes& candidates,
                                     std::size_t most, std::size_t kept = 0);

}  // namespace shapegcode
