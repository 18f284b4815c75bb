#include "shapegcode/plant/modal.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>

#include "shapegcode/error.hpp"

namespace shapegcode {

void check_table(const ModeTable& table) {
  const std::size_t rows = table.position_mm.size();
  if (table.frequency_hz.size() != rows || (!table.damping_ratio.empty() && table.damping_ratio.size() != rows)) {
    throw Error(ErrorKind::argument,
                fmt::format("table of a mode with {} positions, {} frequencies and {} damping ratios", rows,
                            table.frequency_hz.size(), table.damping_ratio.size()));
  }
  if (rows > 0 && (table.axis < 0 || table.axis >= axis_count)) {
    throw Error(ErrorKind::argument, fmt::format("table of a mode over axis {}, 0 to 2 are X, Y and Z", table.axis));
  }
  for (std::size_t k = 0; k < rows; ++k) {
    if (!std::isfinite(table.position_mm[k]) || (k > 0 && !(table.position_mm[k] > table.position_mm[k - 1]))) {
      throw Error(ErrorKind::argument,
                  fmt::format("positions in the table of a mode must be finite and ascend: position {} is {} mm", k,
                              table.position_mm[k]));
    }
    const double damping = table.damping_ratio.empty() ? 0.0 : table.damping_ratio[k];
    static_cast<void>(pole({table.frequency_hz[k], damping, 1.0}));
  }
}

Mode mode_at(const Mode& mode, const ModeTable& table, double position_mm) noexcept {
  if (table.empty()) return mode;
  const std::vector<double>& position = table.position_mm;
  const auto above =
      static_cast<std::size_t>(std::upper_bound(position.begin(), position.end(), position_mm) - position.begin());
  const std::size_t last = position.size() - 1;
  const std::size_t high = std::min(above, last);
  const std::size_t low = above > 0 ? std::min(above - 1, last) : 0;
  const double share = high > low ? (position_mm - position[low]) / (position[high] - position[low]) : 0.0;
  const auto between = [&](const std::vector<double>& values) {
    return values[low] + share * (values[high] - values[low]);
  };
  Mode here = mode;
  here.frequency_hz = between(table.frequency_hz);
  if (!table.damping_ratio.empty()) here.damping_ratio = between(table.damping_ratio);
  return here;
}

Vector3 excitation(const Mode& mode, std::size_t axis) noexcept {
  if (!mode.crosses()) return Vector3::Unit(static_cast<Eigen::Index>(axis));
  return {mode.excited_by[0], mode.excited_by[1], mode.excited_by[2]};
}

void check_shares(const Mode& mode, std::size_t axis) {
  if (!std::isfinite(mode.participation)) {
    throw Error(ErrorKind::argument, fmt::format("participation of a mode of axis {} is not finite", axis));
  }
  for (const double share : mode.excited_by) {
    if (!std::isfinite(share)) {
      throw Error(ErrorKind::argument, fmt::format("excitation of a mode of axis {} is not finite", axis));
    }
  }
}

}  // namespace shapegcode
