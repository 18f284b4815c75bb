#pragma once

#include <array>
#include <vector>

#include "shapegcode/mode.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

/// How a mode depends on where an axis stands: linear in frequency and damping ratio between the rows, constant beyond
/// the ends. An empty table leaves the mode as it is.
struct ModeTable {
  int axis = 0;                       ///< whose position counts: 0, 1, 2 for X, Y, Z
  std::vector<double> position_mm;    ///< strictly ascending
  std::vector<double> frequency_hz;   ///< undamped natural frequency, one per position
  std::vector<double> damping_ratio;  ///< one per position, or none: that of the mode

  [[nodiscard]] bool empty() const noexcept { return position_mm.empty(); }
};

/// One table per mode of every axis; an axis may have fewer tables than modes, the others do not vary.
using AxisModeTables = std::array<std::vector<ModeTable>, axis_count>;

/// Throws Error(argument) unless the table is empty, or names an axis and has strictly ascending, finite positions, as
/// many frequencies above 0, and none or as many damping ratios 0 <= zeta < 1.
void check_table(const ModeTable& table);

/// The mode at a position (mm) of the table's axis; the participation stays. The table must pass check_table.
[[nodiscard]] Mode mode_at(const Mode& mode, const ModeTable& table, double position_mm) noexcept;

}  // namespace shapegcode
