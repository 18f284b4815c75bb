// Private: the control's offset memory, as far as it is known.
#pragma once

#include <array>
#include <map>
#include <optional>

#include "shapegcode/program.hpp"

namespace shapegcode::detail {

using AxisOffsets = std::array<std::optional<double>, axis_count>;

class Offsets {
 public:
  explicit Offsets(const ReaderOptions& options);

  /// Offsets of G54 ... G59, or of G54.1 P`number`; nothing for an axis that is not known.
  [[nodiscard]] AxisOffsets work(int coordinate_system, int number) const;
  void set_work(int coordinate_system, int number, int axis, std::optional<double> value_mm);

  /// Geometry plus wear of H; nothing if neither is known.
  [[nodiscard]] std::optional<double> length(int h_number) const;
  /// Geometry plus wear of D.
  [[nodiscard]] std::optional<double> radius(int d_number) const;
  [[nodiscard]] ToolOffset tool(int number) const;
  void set_tool(int number, const ToolOffset& offset) { tools_[number] = offset; }

 private:
  std::map<int, AxisOffsets> work_;  // 54 ... 59, and 1000 + P
  std::map<int, ToolOffset> tools_;
};

}  // namespace shapegcode::detail
