#include "program/interpret/offsets.hpp"

namespace shapegcode::detail {
namespace {

constexpr int extra_key = 1000;

int key(int coordinate_system, int number) { return coordinate_system == 541 ? extra_key + number : coordinate_system; }

std::optional<double> sum(const std::optional<double>& geometry, const std::optional<double>& wear) {
  if (!geometry && !wear) {
    return std::nullopt;
  }
  return geometry.value_or(0.0) + wear.value_or(0.0);
}

}  // namespace

Offsets::Offsets(const ReaderOptions& options) : tools_(options.tool_offsets) {
  for (std::size_t i = 0; i < options.work_offsets_mm.size(); ++i) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      work_[54 + static_cast<int>(i)][axis] = options.work_offsets_mm[i][axis];
    }
  }
  for (const auto& [number, offset] : options.extra_work_offsets_mm) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      work_[extra_key + number][axis] = offset[axis];
    }
  }
}

AxisOffsets Offsets::work(int coordinate_system, int number) const {
  const auto found = work_.find(key(coordinate_system, number));
  return found == work_.end() ? AxisOffsets{} : found->second;
}

void Offsets::set_work(int coordinate_system, int number, int axis, std::optional<double> value_mm) {
  work_[key(coordinate_system, number)][static_cast<std::size_t>(axis)] = value_mm;
}

ToolOffset Offsets::tool(int number) const {
  const auto found = tools_.find(number);
  return found == tools_.end() ? ToolOffset{} : found->second;
}

std::optional<double> Offsets::length(int h_number) const {
  if (h_number == 0) {
    return 0.0;  // H0 is no offset
  }
  const ToolOffset offset = tool(h_number);
  return sum(offset.length_mm, offset.length_wear_mm);
}

std::optional<double> Offsets::radius(int d_number) const {
  if (d_number == 0) {
    return 0.0;  // D0 is no offset
  }
  const ToolOffset offset = tool(d_number);
  return sum(offset.radius_mm, offset.radius_wear_mm);
}

}  // namespace shapegcode::detail
