#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/identify/arma.hpp"

namespace shapegcode {

/// How the force runs between its samples.
enum class ForceHold : std::uint8_t {
  linear,        ///< straight from sample to sample
  band_limited,  ///< as behind an anti-aliasing filter: sinc interpolation, right up to .45 of the sampling rate
  impulse,       ///< blows at the samples, each just before the response is read: force times period is its momentum
};

/// What belongs to the model of a tap besides its modes.
struct ModalFitOptions {
  Quantity quantity = Quantity::acceleration;
  /// A constant offset of the response per record.
  bool with_offset = true;
  /// Modes far below: the structure moves like a free mass, displacement = integral of the integral of force, over it.
  bool with_mass_line = false;
  /// Modes far above: a spring without mass, displacement = compliance * force (acceleration: the force's second
  /// difference).
  bool with_compliance = false;
  /// Intervals that hold for residuals correlated over time as well (stationary noise of any colour).
  bool coloured_residuals = false;
  ForceHold hold = ForceHold::linear;
  /// Standard deviation in N of white noise on the measured force. In a pulse of up to 128 samples the true force is
  /// estimated along with the modes; the effect on a longer one is added to the covariance, to first order.
  double force_noise_n = 0.0;
  int most_iterations = 60;
};

/// Figures that every fit has.
struct FitQuality {
  double sum_of_squares = 0.0;            ///< of the residuals, in the response's unit squared
  double log_likelihood = 0.0;            ///< for white normal residuals of the same variance in all records
  std::size_t samples = 0;                ///< of all records together
  std::size_t parameters = 0;             ///< fitted ones, offsets and amplitudes included
  double residual_autocorrelation = 0.0;  ///< at a lag of one sample, no unit; white noise: about 0
  std::vector<double> residual_rms;       ///< per record, in the response's unit
  std::vector<Eigen::VectorXd> fitted;    ///< per record: the model's response, offset included
  int iterations = 0;
  bool converged = false;
  std::string reason;  ///< why it has not converged; empty if it has
};

/// Result of fit_modes. Entry r belongs to the r-th start; a mode may have passed another one.
struct ModalFit {
  std::vector<double> omega_rad_s;    ///< undamped natural frequencies
  std::vector<double> damping_ratio;  ///< no unit
  std::vector<double> inverse_mass;   ///< residues 1/m in 1/kg, negative where the mode's signs differ
  Eigen::MatrixXd covariance;         ///< (3n, 3n) of omega, zeta, 1/m of the first mode, then of the second, ...
  double mass_line = 0.0;             ///< 1/kg, 0 without it
  double compliance = 0.0;            ///< m/N, 0 without it
  std::vector<double> offset;         ///< per record, in the response's unit
  FitQuality quality;
};

/// Fits modes to taps by output error: the least squares, for white noise on the response the maximum likelihood, of
/// measured minus modelled response. The model is the sum over modes of (1/m) s^q/(s^2 + 2 zeta omega s + omega^2)
/// applied to the measured force (q = 0 displacement, 1 velocity, 2 acceleration), from rest at the first sample; the
/// force runs between its samples as `hold` says and the modes are propagated exactly.
///
/// `start`: n >= 1 modes (rad/s, below Nyquist; 0 < zeta < 1), e.g. from arma_driven. The fit is Levenberg-Marquardt in
/// ln omega and ln zeta with exact derivatives; 1/m and what the options add are linear and eliminated (variable
/// projection). The covariance is the residual variance over (J'J), with degrees of freedom = samples - parameters;
/// noise on the force adds, to first order, what it does to the modelled response.
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
/// records, amplitude and phase are each record's own. Whether displacement, velocity or acceleration was measured
/// makes no difference.
///
/// `start`: n >= 1 modes (rad/s, below Nyquist; 0 < zeta < 1), e.g. from arma_decay. Method and errors as in fit_modes.
[[nodiscard]] DecayFit fit_decay(Responses responses, double period_s, const NaturalModes& start,
                                 const DecayFitOptions& options);

/// Candidates in the order in which they explain most of what those before them leave.
struct ModeRanking {
  std::vector<std::size_t> chosen;     ///< indices into the candidates
  std::vector<double> sum_of_squares;  ///< of what is left after each choice, in the response's unit squared
  double total = 0.0;                  ///< of the responses, offsets taken out
};

/// Ranks candidates for the modes of taps by forward selection: at each step the candidate whose response to the force,
/// together with those already chosen, leaves the least squares; residues are fitted, frequencies and damping ratios
/// are not. Gives starts for fit_modes out of the poles of a stabilisation chart, also where the model with just as
/// many modes misses a weak one. Stops early where no candidate explains anything more.
///
/// `candidates` as the starts of fit_modes; `most` >= 1: how many to choose. The first `kept` of them are chosen before
/// all others, in their order: handed over as fitted, they leave only what is new to the rest of the candidates. Throws
/// Error(argument) as fit_modes.
[[nodiscard]] ModeRanking rank_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& candidates,
                                     std::size_t most, std::size_t kept = 0,
                                     Quantity quantity = Quantity::acceleration);

/// The same for free decays: amplitude and phase are each record's own.
[[nodiscard]] ModeRanking rank_modes(Responses responses, double period_s, const NaturalModes& candidates,
                                     std::size_t most, std::size_t kept = 0);

}  // namespace shapegcode
