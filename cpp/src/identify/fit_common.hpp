#pragma once

#include <Eigen/Core>

#include "identify/separable_fit.hpp"
#include "shapegcode/identify/arma.hpp"
#include "shapegcode/identify/modal_fit.hpp"

namespace shapegcode::identification {

/// Throws Error(argument) unless there is at least one mode and each has 0 < omega*period < pi and 0 < zeta < 1.
void check_modes(const NaturalModes& modes, double period_s);

/// Throws Error(argument) unless a model of 1 to 50 modes is asked for.
void check_mode_count(int n_modes);

/// Throws Error(argument) unless `samples` leave degrees of freedom.
void check_enough(std::size_t samples, std::size_t parameters);

/// (ln omega, ln zeta) of each mode in turn, and back.
[[nodiscard]] Eigen::VectorXd logarithms(const NaturalModes& modes);
[[nodiscard]] NaturalModes from_logarithms(const Eigen::VectorXd& theta);

/// Keeps omega*period between 1e-6 and 0.999 pi and zeta between 1e-7 and 0.99; true if anything was outside.
[[nodiscard]] bool clamp_logarithms(Eigen::VectorXd& theta, double period_s);

/// What every fit tells; takes the fitted responses out of `fit`.
[[nodiscard]] FitQuality quality_of(SeparableFit& fit, std::size_t parameters);

}  // namespace shapegcode::identification
