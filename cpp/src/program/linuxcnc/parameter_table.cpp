#include "program/linuxcnc/parameter_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "program/linuxcnc/program_text.hpp"

namespace shapegcode::linuxcnc {
namespace {

constexpr std::int64_t last_user_parameter = 5000;
constexpr std::int64_t shows_debug_comments = 5599;

constexpr std::array<std::pair<std::string_view, Predefined>, 29> predefined_names = {{
    {"_x", Predefined::x},
    {"_y", Predefined::y},
    {"_z", Predefined::z},
    {"_vmajor", Predefined::vmajor},
    {"_vminor", Predefined::vminor},
    {"_task", Predefined::task},
    {"_motion_mode", Predefined::motion_mode},
    {"_plane", Predefined::plane},
    {"_coord_system", Predefined::coord_system},
    {"_metric", Predefined::metric},
    {"_imperial", Predefined::imperial},
    {"_absolute", Predefined::absolute},
    {"_incremental", Predefined::incremental},
    {"_inverse_time", Predefined::inverse_time},
    {"_units_per_minute", Predefined::units_per_minute},
    {"_units_per_rev", Predefined::units_per_rev},
    {"_spindle_on", Predefined::spindle_on},
    {"_spindle_cw", Predefined::spindle_cw},
    {"_mist", Predefined::mist},
    {"_flood", Predefined::flood},
    {"_feed", Predefined::feed},
    {"_rpm", Predefined::rpm},
    {"_current_tool", Predefined::current_tool},
    {"_selected_tool", Predefined::selected_tool},
    {"_call_level", Predefined::call_level},
    {"_value", Predefined::value},
    {"_value_returned", Predefined::value_returned},
    {"_ccomp", Predefined::ccomp},
    {"_tool_offset", Predefined::tool_offset},
}};

std::optional<double> flag(bool holds) { return holds ? 1.0 : 0.0; }

std::optional<double> in_unit(std::optional<double> length_mm, double unit_mm) {
  return length_mm ? std::optional(*length_mm / unit_mm) : std::nullopt;
}

}  // namespace

NameId ParameterNames::id(std::string_view name) {
  const auto [place, is_new] = ids_.try_emplace(std::string(name), static_cast<NameId>(names_.size()));
  if (is_new) {
    const auto* const found = std::ranges::find(predefined_names, name, [](const auto& each) { return each.first; });
    const Predefined what = found == predefined_names.end() ? Predefined::none : found->second;
    names_.push_back({std::string(name), name.starts_with('_'), what});
  }
  return place->second;
}

ParameterTable::ParameterTable(const State& state, std::vector<Frame>& frames, const ParameterNames& names)
    : state_(state), frames_(frames), names_(names), numbered_(static_cast<std::size_t>(last_user_parameter) + 1) {}

double ParameterTable::numbered(std::int64_t number) const {
  if (number >= 1 && number <= static_cast<std::int64_t>(max_arguments)) {
    return frames_.back().locals[static_cast<std::size_t>(number)];
  }
  if (number >= 1 && number <= last_user_parameter) return numbered_[static_cast<std::size_t>(number)];
  const std::optional<double> value = of_state(number);
  if (!value) {
    refuse(fmt::format("parameter #{} is known to the machine only (its parameter file, a probe, an offset)", number));
  }
  return *value;
}

double ParameterTable::named(NameId name) const {
  const std::optional<double> value = find(name);
  if (!value) refuse(fmt::format("parameter #<{}> has no value here", shown(names_[name].text)));
  return *value;
}

std::optional<double> ParameterTable::find(NameId name) const {
  const ParameterName& what = names_[name];
  const auto& own = what.is_global ? global_ : frames_.back().names;
  if (const auto found = own.find(name); found != own.end()) return found->second;
  return predefined(what.predefined);
}

void ParameterTable::set_numbered(double parameter, double value) {
  const std::int64_t number = rounded(parameter);
  if (number >= 1 && number <= static_cast<std::int64_t>(max_arguments)) {
    frames_.back().locals[static_cast<std::size_t>(number)] = value;
  } else if (number >= 1 && number <= last_user_parameter) {
    numbered_[static_cast<std::size_t>(number)] = value;
  } else if (number != shows_debug_comments) {
    refuse(fmt::format("parameter #{} is LinuxCNC's own: programs that set it are not read", number));
  }
}

void ParameterTable::set_named(NameId name, double value) {
  (names_[name].is_global ? global_ : frames_.back().names)[name] = value;
}

std::optional<double> ParameterTable::of_state(std::int64_t number) const {
  if (number >= 5211 && number <= 5213) {
    return in_unit(state_.g92[static_cast<std::size_t>(number - 5211)], state_.machine_unit_mm);
  }
  if (number == 5220) return state_.modes.system;
  const std::int64_t of_system = (number - 5200) % 20;
  if (number >= 5221 && number <= 5383 && of_system >= 1 && of_system <= 3) {
    const Triple& offsets = state_.work[static_cast<std::size_t>((number - 5201) / 20)];
    return in_unit(offsets[static_cast<std::size_t>(of_system - 1)], state_.machine_unit_mm);
  }
  if (number >= 5400 && number <= 5410) return of_tool(number);
  if (number >= 5420 && number <= 5422) {
    return in_unit(state_.position[static_cast<std::size_t>(number - 5420)], state_.unit_mm());
  }
  if (number >= 5423 && number <= 5428) return 0.0;
  if (number == shows_debug_comments) return 1.0;
  return std::nullopt;
}

std::optional<double> ParameterTable::of_tool(std::int64_t number) const {
  if (number == 5400) return static_cast<double>(state_.tool);
  // The tool in the spindle, in the unit of the table whatever the program's is.
  if (state_.table == nullptr) return std::nullopt;
  const auto row = state_.table->tools.find(state_.tool);
  if (row == state_.table->tools.end()) return std::nullopt;
  double value = 0.0;
  if (number <= 5403) {
    value = row->second.offset_mm[static_cast<std::size_t>(number - 5401)];
  } else if (number == 5410) {
    value = row->second.diameter_mm;
  }
  return value / state_.table->unit_mm;
}

std::optional<double> ParameterTable::predefined(Predefined what) const {
  switch (what) {
    case Predefined::none:
      return std::nullopt;
    case Predefined::x:
      return in_unit(state_.position[0], state_.unit_mm());
    case Predefined::y:
      return in_unit(state_.position[1], state_.unit_mm());
    case Predefined::z:
      return in_unit(state_.position[2], state_.unit_mm());
    case Predefined::vmajor:
      return 2.9;
    case Predefined::vminor:
    case Predefined::task:
    case Predefined::value:
    case Predefined::value_returned:
      return 0.0;
    case Predefined::current_tool:
      return static_cast<double>(state_.tool);
    case Predefined::selected_tool:
      return static_cast<double>(state_.selected);
    case Predefined::call_level:
      return static_cast<double>(frames_.size()) - 1.0;
    case Predefined::ccomp:
      return 400.0;
    case Predefined::tool_offset:
      return flag(state_.length_number != 0);
    default:
      return of_modes(what);
  }
}

std::optional<double> ParameterTable::of_modes(Predefined what) const {
  const Modes& modes = state_.modes;
  switch (what) {
    case Predefined::motion_mode:
      return modes.motion;
    case Predefined::plane:
      return modes.plane;
    case Predefined::coord_system:
      return modes.system <= 6 ? 530 + 10 * modes.system : 584 + modes.system;
    case Predefined::metric:
      return flag(modes.units == 210);
    case Predefined::imperial:
      return flag(modes.units == 200);
    case Predefined::absolute:
      return flag(modes.distance == 900);
    case Predefined::incremental:
      return flag(modes.distance == 910);
    case Predefined::inverse_time:
      return flag(modes.feed_mode == 930);
    case Predefined::units_per_minute:
      return flag(modes.feed_mode == 940);
    case Predefined::units_per_rev:
      return flag(modes.feed_mode == 950);
    case Predefined::spindle_on:
      return flag(modes.spindle == 3 || modes.spindle == 4);
    case Predefined::spindle_cw:
      return flag(modes.spindle == 3);
    case Predefined::mist:
      return flag(modes.mist);
    case Predefined::flood:
      return flag(modes.flood);
    case Predefined::feed:
      return modes.feed;
    default:
      return modes.speed;
  }
}

}  // namespace shapegcode::linuxcnc
