#pragma once

#include <optional>
#include <span>
#include <vector>

namespace shapegcode {

/// Figures of a profile after ISO 4287 (ISO 21920-2), in mm.
struct Roughness {
  double cutoff_mm = 0.0;     ///< lambda_c: separates roughness from waviness
  double evaluated_mm = 0.0;  ///< length that the figures speak of: the profile less one cut-off at each end
  double ra_mm = 0.0;         ///< arithmetic mean height of the roughness profile
  double rz_mm = 0.0;         ///< mean over sampling lengths (one cut-off each) of highest peak less deepest valley
  double wa_mm = 0.0;         ///< arithmetic mean height of the waviness profile
};

/// Gaussian low-pass of ISO 16610-21: weight exp(-pi (x / (alpha L))^2) / (alpha L), alpha = sqrt(ln 2 / pi), so that a
/// wave of length L comes through with one half. The weights end at one L to either side (where they are 1e-6 of the
/// middle) and are made to sum to one, also where the profile ends within them. Throws Error(argument) unless spacing
/// and cut-off are > 0.
[[nodiscard]] std::vector<double> gaussian_low_pass(std::span<const double> profile_mm, double spacing_mm,
                                                    double cutoff_mm);

/// The largest of the cut-offs 0.8, 0.25 and 0.08 mm of ISO 4288 of which five sampling lengths and one cut-off more at
/// either end fit into a profile, and that is at least five stations long; none if there is none.
[[nodiscard]] std::optional<double> standard_cutoff_mm(double length_mm, double spacing_mm) noexcept;

/// Roughness and waviness of an evenly spaced profile. `lambda_s_mm` > 0 smooths it first (0: no such filter). What is
/// waviness is measured from its own mean: form has to be removed before. Throws Error(argument) if less than one
/// sampling length remains, or as gaussian_low_pass() does.
[[nodiscard]] Roughness measure_roughness(std::span<const double> profile_mm, double spacing_mm, double cutoff_mm,
                                          double lambda_s_mm = 0.0);

/// The profile less its least-squares straight line. Empty stays empty.
[[nodiscard]] std::vector<double> without_line(std::span<const double> profile_mm);

/// The profile of a circle's wall less its least-squares circle: mean, sine and cosine of the angle, which steps by
/// `step_rad` from one value to the next. Where this spans less than a twentieth of a turn only the mean and the slope
/// can be told apart, and the line is taken off instead.
[[nodiscard]] std::vector<double> without_circle(std::span<const double> profile_mm, double step_rad);

}  // namespace shapegcode
