#include "program/linuxcnc/interpreter_state.hpp"

#include <fmt/format.h>

namespace shapegcode::linuxcnc {

void State::shift(std::size_t axis, std::optional<double> before, std::optional<double> after) {
  if (before == after && before) return;
  std::optional<double>& here = position[axis];
  if (here && before && after) {
    here = *here + *before - *after;
  } else {
    here.reset();
  }
}

void State::select_system(int system) {
  if (system == modes.system) return;
  for (std::size_t axis = 0; axis < 3; ++axis) shift(axis, offsets(modes.system)[axis], offsets(system)[axis]);
  modes.system = system;
}

void State::set_length(std::optional<double> new_length, std::int64_t number) {
  if (!new_length && !length && number == length_number) return;
  shift(2, length, new_length);
  length = new_length;
  length_number = number;
}

std::string system_words(std::int64_t system) {
  return system <= 6 ? fmt::format("G{}", 53 + system) : fmt::format("G54.1 P{}", system - 6);
}

}  // namespace shapegcode::linuxcnc
