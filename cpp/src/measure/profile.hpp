// Processing of a wall's profile before its roughness is measured.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace shapegcode {

/// The largest of the cut-offs 0.8, 0.25 and 0.08 mm of ISO 4288 of which five sampling lengths and one cut-off more at
/// either end fit into a profile, and that is at least five stations long; none if there is none.
[[nodiscard]] std::optional<double> standard_cutoff_mm(double length_mm, double spacing_mm) noexcept;

/// The profile less its least-squares straight line. Empty stays empty.
[[nodiscard]] std::vector<double> without_line(std::span<const double> profile_mm);

/// The profile of a circle's wall less its least-squares circle: mean, sine and cosine of the angle, which steps by
/// `step_rad` from one value to the next. Where this spans less than a twentieth of a turn only the mean and the slope
/// can be told apart, and the line is taken off instead.
[[nodiscard]] std::vector<double> without_circle(std::span<const double> profile_mm, double step_rad);

}  // namespace shapegcode
