#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace shapegcode {

/// Measured quantity: the order of the derivative of the displacement.
enum class Quantity : std::uint8_t { displacement = 0, velocity = 1, acceleration = 2 };

/// One hammer impact: force (N) and response (m, m/s or m/s²) at the same instants. Views: the caller's data must
/// outlive them.
struct TapSignals {
  std::span<const double> force_n;
  std::span<const double> response;
};

/// Free decays: the responses of one or several records. Views: the caller's data must outlive them.
using Responses = std::span<const std::span<const double>>;

/// Natural frequencies (rad/s, undamped) and damping ratios (no unit) of modes, of equal length.
struct NaturalModes {
  std::vector<double> omega_rad_s;
  std::vector<double> damping_ratio;
};

/// ARMA(2n, 2n-1) model of n modes: response = B(z)/A(z) force, A = 1 - phi_1/z - ... - phi_2n/z^2n.
struct Arma {
  /// phi_1 ... phi_2n in the sign convention of paper 003, eq. 1: lambda^2n - phi_1 lambda^(2n-1) - ... - phi_2n = 0.
  Eigen::VectorXd phi;
  /// b_0, b_1, ...: one row for all impacts with 2n+1 terms, or one row per free decay with 2n.
  Eigen::MatrixXd numerator;
  /// theta_k = -b_k/b_0 of each row (not a number where b_0 is 0).
  Eigen::MatrixXd theta;
  std::vector<std::complex<double>> poles;  ///< roots lambda
  std::vector<double> residual_rms;         ///< per record: response minus B/A force, in the response's unit
  int iterations = 0;
  bool converged = false;  ///< phi or the residuals converged; the result is the best of all iterations
};

/// Joint model of several impacts at the same point, from rest at the first sample: iterated least squares, in which
/// force and response are filtered with 1/A of the previous round (Steiglitz, McBride 1965), so that noise on the
/// response does not bias the poles as in plain least squares. Unstable poles are reflected into the unit circle.
///
/// `plain`: one round of unfiltered least squares instead (minimises the equation error, not the response error).
/// Without noise and with the right number of modes both are exact.
///
/// The numerator has 2n+1 terms: with a force linear between samples the acceleration responds without delay. Throws
/// Error(argument), naming record and sample, if there is no record, a value is not finite, force and response differ
/// in length or a force is zero throughout; on n_modes outside 1 ... 50, or fewer than 8 n_modes + 8 samples;
/// Error(numeric) if the coefficients are not finite.
[[nodiscard]] Arma arma_driven(std::span<const TapSignals> taps, int n_modes, bool plain = false);

/// Joint model of several free decays: the same with a unit impulse at the first sample as force; poles are common,
/// each record has its own numerator (initial state). Errors as in arma_driven.
[[nodiscard]] Arma arma_decay(Responses responses, int n_modes, bool plain = false);

/// Modes of discrete poles, ascending in frequency: omega = |ln lambda|/period, zeta = -Re(ln lambda)/|ln lambda|
/// (paper 003, eq. 5-6). Only stable complex pairs are kept: real poles (including those at the Nyquist frequency) and
/// poles on or outside the unit circle are no modes. Throws Error(argument) on a period <= 0.
[[nodiscard]] NaturalModes poles_to_modes(std::span<const std::complex<double>> poles, double period_s);

/// Poles of models with n = 1 ... n_max modes for a stabilisation chart; entry n-1 holds 2n poles of the samples'
/// period.
///
/// A subspace method (ESPRIT; Roy, Kailath 1989): all orders follow from the eigenvectors of one covariance matrix of
/// the free decay. For impacts the decay is the correlation of response with force, at lags beyond the length of the
/// force pulse: impacts are weighted by their force, and noise uncorrelated with the force cancels. The covariance uses
/// delays of one or more samples each, such that the highest frequency with content is sampled at least twice per
/// cycle. With more than one, a mode not visible in the spectrum (60 dB below the strongest) may appear aliased.
///
/// Throws Error(argument) on signals that arma_driven or arma_decay refuses, n_max outside 1 ... 50, or records too
/// short for n_max (8 n_max + 8 samples needed).
[[nodiscard]] std::vector<std::vector<std::complex<double>>> stabilisation_poles(std::span<const TapSignals> taps,
                                                                                 int n_max);
[[nodiscard]] std::vector<std::vector<std::complex<double>>> stabilisation_poles(Responses responses, int n_max);

}  // namespace shapegcode
