#include "identify/fit_common.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/refuse.hpp"

namespace shapegcode::identification {

using detail::refuse;

void check_modes(const NaturalModes& modes, double period_s) {
  const std::size_t count = modes.omega_rad_s.size();
  if (count == 0 || count != modes.damping_ratio.size()) {
    refuse("{} natural frequencies and {} damping ratios: at least one of each, and as many, needed", count,
           modes.damping_ratio.size());
  }
  const double nyquist = std::numbers::pi / period_s;
  for (std::size_t m = 0; m < count; ++m) {
    const double omega = modes.omega_rad_s[m];
    const double zeta = modes.damping_ratio[m];
    if (!(omega > 0.0) || !(omega < nyquist)) {
      refuse("mode {} has {:g} rad/s, must be above 0 and below the Nyquist frequency {:g} rad/s", m, omega, nyquist);
    }
    if (!(zeta > 0.0) || !(zeta < 1.0)) {
      refuse("mode {} has damping ratio {:g}, must be above 0 and below 1", m, zeta);
    }
  }
}

void check_mode_count(int n_modes) {
  constexpr int most = 50;
  if (n_modes >= 1 && n_modes <= most) return;
  refuse("model of {} modes asked for, 1 to {} can be", n_modes, most);
}

void check_enough(std::size_t samples, std::size_t parameters) {
  if (samples > parameters) return;
  refuse("{} samples for {} parameters: more samples than parameters needed", samples, parameters);
}

Eigen::VectorXd logarithms(const NaturalModes& modes) {
  Eigen::VectorXd theta(2 * static_cast<Eigen::Index>(modes.omega_rad_s.size()));
  for (Eigen::Index m = 0; 2 * m < theta.size(); ++m) {
    theta[2 * m] = std::log(modes.omega_rad_s[static_cast<std::size_t>(m)]);
    theta[2 * m + 1] = std::log(modes.damping_ratio[static_cast<std::size_t>(m)]);
  }
  return theta;
}

NaturalModes from_logarithms(const Eigen::VectorXd& theta) {
  NaturalModes modes;
  for (Eigen::Index m = 0; 2 * m < theta.size(); ++m) {
    modes.omega_rad_s.push_back(std::exp(theta[2 * m]));
    modes.damping_ratio.push_back(std::exp(theta[2 * m + 1]));
  }
  return modes;
}

bool clamp_logarithms(Eigen::VectorXd& theta, double period_s) {
  const Eigen::VectorXd before = theta;
  const double slowest = std::log(1e-6 / period_s);
  const double fastest = std::log(0.999 * std::numbers::pi / period_s);
  for (Eigen::Index m = 0; 2 * m < theta.size(); ++m) {
    theta[2 * m] = std::min(std::max(theta[2 * m], slowest), fastest);
    theta[2 * m + 1] = std::min(std::max(theta[2 * m + 1], std::log(1e-7)), std::log(0.99));
  }
  return (theta.array() != before.array()).any();
}

FitQuality quality_of(SeparableFit& fit, std::size_t parameters) {
  FitQuality quality;
  for (const Eigen::VectorXd& residual : fit.residual) {
    quality.samples += static_cast<std::size_t>(residual.size());
    quality.residual_rms.push_back(std::sqrt(residual.squaredNorm() / static_cast<double>(residual.size())));
  }
  const auto samples = static_cast<double>(quality.samples);
  quality.sum_of_squares = fit.sum_of_squares;
  quality.log_likelihood = -0.5 * samples * (std::log(2.0 * std::numbers::pi * fit.sum_of_squares / samples) + 1.0);
  quality.parameters = parameters;
  quality.residual_autocorrelation = lag_one_autocorrelation(fit.residual);
  quality.fitted = std::move(fit.fitted);
  quality.iterations = fit.iterations;
  quality.converged = fit.converged;
  quality.reason = std::move(fit.reason);
  return quality;
}

}  // namespace shapegcode::identification
