// Private: the names of parameters, each with a number, so that no text is compared while a program runs.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace shapegcode::linuxcnc {

using NameId = std::uint32_t;

/// Named parameters that LinuxCNC defines.
enum class Predefined : std::uint8_t {
  none,
  x,
  y,
  z,
  vmajor,
  vminor,
  task,
  motion_mode,
  plane,
  coord_system,
  metric,
  imperial,
  absolute,
  incremental,
  inverse_time,
  units_per_minute,
  units_per_rev,
  spindle_on,
  spindle_cw,
  mist,
  flood,
  feed,
  rpm,
  current_tool,
  selected_tool,
  call_level,
  value,
  value_returned,
  ccomp,
  tool_offset,
};

struct ParameterName {
  std::string text;
  bool is_global = false;  ///< it begins with _
  Predefined predefined = Predefined::none;
};

class ParameterNames {
 public:
  NameId id(std::string_view name);
  [[nodiscard]] const ParameterName& operator[](NameId id) const { return names_[id]; }
  [[nodiscard]] std::size_t size() const noexcept { return names_.size(); }

 private:
  std::unordered_map<std::string, NameId> ids_;
  std::vector<ParameterName> names_;
};

}  // namespace shapegcode::linuxcnc
