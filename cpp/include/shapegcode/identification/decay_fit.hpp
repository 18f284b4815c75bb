#pragma once

#include <Eigen/Core>
#include <vector>

#include "shapegcode/identification/modal_fit.hpp"
#include "shapegcode/identification/signals.hpp"

namespace shapegcode {

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

}  // namespace shapegcode
