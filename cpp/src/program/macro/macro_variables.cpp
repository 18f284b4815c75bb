#include "program/macro/macro_variables.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "program/macro/macro_text.hpp"

namespace shapegcode {
namespace {

constexpr int first_common = 100;
constexpr int last_common = 199;
constexpr int first_retained = 500;
constexpr int last_retained = 999;
constexpr int first_system = 1000;
constexpr int last_local = 33;

bool is_retained(int number) noexcept { return number >= first_retained && number <= last_retained; }

bool is_common(int number) noexcept { return number >= first_common && number <= last_common; }

std::string name_of(int number) { return fmt::format("#{}", number); }

}  // namespace

bool SystemVariables::read(int /*number*/, MacroValue& /*value*/) { return false; }

bool SystemVariables::write(int /*number*/, MacroValue /*value*/) { return false; }

MacroVariables::MacroVariables(const std::map<int, double>& retained, SystemVariables* system) : system_(system) {
  for (const auto& [number, value] : retained) {
    if (!is_retained(number)) {
      throw Error(ErrorKind::argument, "variable " + name_of(number) + " is not retained: #500 ... #999 are");
    }
    if (!std::isfinite(value)) {
      throw Error(ErrorKind::argument, "variable " + name_of(number) + " = " + macro::shown(value) + " is not finite");
    }
    retained_[static_cast<std::size_t>(number - first_retained)] = {value, true};
  }
}

MacroValue* MacroVariables::find(int number) noexcept {
  if (number >= 1 && number <= last_local) {
    return &locals_[level_][static_cast<std::size_t>(number)];
  }
  if (is_common(number)) {
    return &common_[static_cast<std::size_t>(number - first_common)];
  }
  return nullptr;
}

MacroValue MacroVariables::read(int number, std::uint32_t line, std::uint32_t column) {
  if (number == 0) {
    return std::nullopt;
  }
  if (is_common(number) && common_forgotten_[static_cast<std::size_t>(number - first_common)]) {
    throw UnknownValue(number, "the value of variable " + name_of(number) + " is known to the control only", line,
                       column);
  }
  if (const MacroValue* value = find(number)) {
    return *value;
  }
  if (is_retained(number)) {
    const Retained& retained = retained_[static_cast<std::size_t>(number - first_retained)];
    if (!retained.known) {
      throw UnknownValue(number,
                         "variable " + name_of(number) +
                             " is retained by the control and its value is not known here: give it in the machine "
                             "file (input.variables)",
                         line, column);
    }
    return retained.value;
  }
  MacroValue value;
  if (number >= first_system && system_ != nullptr && system_->read(number, value)) {
    return value;
  }
  throw alarm_error(115, "there is no variable " + name_of(number), line, column);
}

void MacroVariables::write(int number, MacroValue value, std::uint32_t line, std::uint32_t column) {
  if (number == 0) {
    throw alarm_error(116, "variable #0 is always vacant and cannot be written", line, column);
  }
  if (MacroValue* found = find(number)) {
    *found = value;
    if (is_common(number)) {
      common_forgotten_[static_cast<std::size_t>(number - first_common)] = false;
    }
    return;
  }
  if (is_retained(number)) {
    retained_[static_cast<std::size_t>(number - first_retained)] = {value, true};
    return;
  }
  if (number >= first_system && system_ != nullptr) {
    if (system_->write(number, value)) {
      return;
    }
    MacroValue present;
    if (system_->read(number, present)) {
      throw alarm_error(116, "variable " + name_of(number) + " can only be read", line, column);
    }
  }
  throw alarm_error(115, "there is no variable " + name_of(number), line, column);
}

void MacroVariables::forget(int number) noexcept {
  if (number == 0) {
    common_forgotten_.fill(true);
    retained_.fill({std::nullopt, false});
  } else if (is_common(number)) {
    common_forgotten_[static_cast<std::size_t>(number - first_common)] = true;
  } else if (is_retained(number)) {
    retained_[static_cast<std::size_t>(number - first_retained)] = {std::nullopt, false};
  }
}

void MacroVariables::push_level(const std::array<MacroValue, 34>& arguments, std::uint32_t line, std::uint32_t column) {
  if (level_ + 1 == max_levels) {
    throw alarm_error(122, fmt::format("macro calls nested deeper than {} levels", max_levels - 1), line, column);
  }
  ++level_;
  locals_[level_] = arguments;
  locals_[level_][0] = std::nullopt;
}

void MacroVariables::pop_level() {
  if (level_ == 0) {
    throw Error(ErrorKind::argument, "no macro call level to leave");
  }
  --level_;
}

}  // namespace shapegcode
