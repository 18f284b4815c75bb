#include "program/linuxcnc/offset_codes.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <string_view>

#include "program/dialect/expanded_lines.hpp"
#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

using dialect::number_text;

constexpr std::int64_t dynamic_number = 999;  // H number under which the expanded program holds the length of G43.1
constexpr std::uint32_t linear_axes = letter_set(axis_letters);

void refuse_x_and_y(std::string_view code, const WordValues& values) {
  if (values.get('x', 0.0) != 0.0 || values.get('y', 0.0) != 0.0) {
    refuse(fmt::format("{} with an offset of X or Y: only that of Z is read", code));
  }
}

}  // namespace

void OffsetCodes::length(int code, const WordValues& values) {
  const std::int64_t number = values.has('h') ? truncated(values['h']) : state_.tool;
  if (code == 490 || (code == 430 && number == 0)) {
    state_.set_length(0.0, 0);
    put_("G49");
    return;
  }
  if (code == 431) {
    dynamic_length(values);
    return;
  }
  const auto known = state_.lengths.find(number);
  if (state_.table != nullptr) {
    if (known == state_.lengths.end())
      refuse(fmt::format("G43 H{}: {} has no tool {}", number, state_.table->file, number));
    const auto tool = state_.table->tools.find(number);
    if (tool != state_.table->tools.end() && (tool->second.offset_mm[0] != 0.0 || tool->second.offset_mm[1] != 0.0)) {
      refuse(fmt::format("G43 H{}: its offset has X or Y: only that of Z is read", number));
    }
  }
  state_.set_length(known == state_.lengths.end() ? std::nullopt : std::optional(known->second), number);
  put_(fmt::format("G43H{}", number));
}

void OffsetCodes::dynamic_length(const WordValues& values) {
  refuse_x_and_y("G43.1", values);
  const double length = values.get('z', 0.0);
  // Its number is free in the expanded program; G49 first, so that the reader knows the change.
  put_("G49");
  put_(fmt::format("G90G10L10P{}R{}", dynamic_number, number_text(length)));
  if (state_.modes.distance == 910) put_("G91");
  put_(fmt::format("G43H{}", dynamic_number));
  state_.set_length(length * state_.unit_mm(), dynamic_number);
}

void OffsetCodes::one_shot(int code, const WordValues& values) {
  switch (code) {
    case 100:
      data(values);
      return;
    case 281:
    case 301:
      return;  // stores the present position: nothing moves
    case 280:
    case 300:
      reference(code, values);
      return;
    case 520:
      local(values);
      return;
    case 920:
      set_position(values);
      return;
    default:
      set_offsets(code);
  }
}

std::optional<WordValues> OffsetCodes::in_program(const WordValues& values, bool is_rapid) {
  WordValues found = values;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const char letter = axis_letters[axis];
    if (!values.has(letter)) continue;
    const std::optional<double> work = state_.offsets(state_.modes.system)[axis];
    const std::optional<double> shift = state_.g92[axis];
    const std::optional<double> length = axis == 2 ? state_.length : 0.0;
    if (!work || !shift || !length) {
      if (!is_rapid) {
        refuse("G53 G1: a cutting move in machine coordinates needs the work offset (input.work_offsets)");
      }
      put_in_absolute("G53G00" + words_of(values));
      forget(values);
      return std::nullopt;
    }
    found.set(letter, values[letter] - (*work + *shift + *length) / state_.unit_mm());
  }
  return found;
}

void OffsetCodes::forget(const WordValues& values) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (values.has(axis_letters[axis])) state_.position[axis].reset();
  }
}

void OffsetCodes::put_in_absolute(const std::string& text) {
  if (state_.modes.distance == 910) {
    put_("G90");
    put_(text);
    put_("G91");
  } else {
    put_("G90" + text);
  }
}

void OffsetCodes::reference(int code, const WordValues& values) {
  const int distance = state_.modes.distance;
  if (values.has_any(linear_axes)) {
    put_(fmt::format("G{}G{}{}", distance / 10, code / 10, words_of(values)));
    forget(values);
    return;
  }
  put_(fmt::format("G91G{}X0.Y0.Z0.", code / 10));
  if (distance == 900) put_("G90");
  state_.position.fill(std::nullopt);
}

void OffsetCodes::local(const WordValues& values) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!values.has(axis_letters[axis])) continue;
    const double offset = values[axis_letters[axis]] * state_.unit_mm();
    if (state_.g92[axis] != 0.0 && !state_.g52) {
      refuse("G52 after G92: both set one offset on LinuxCNC, and two on FANUC");
    }
    state_.shift(axis, state_.g92[axis], offset);
    state_.g92[axis] = offset;
  }
  if (values.has_any(linear_axes)) {
    state_.g52 =
        state_.g92[0].value_or(0.0) != 0.0 || state_.g92[1].value_or(0.0) != 0.0 || state_.g92[2].value_or(0.0) != 0.0;
    put_("G52" + words_of(values));
  }
}

void OffsetCodes::set_position(const WordValues& values) {
  if (state_.g52) refuse("G92 after G52: both set one offset on LinuxCNC, and two on FANUC");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!values.has(axis_letters[axis])) continue;
    const double to = values[axis_letters[axis]] * state_.unit_mm();
    std::optional<double>& here = state_.position[axis];
    std::optional<double>& offset = state_.g92[axis];
    offset = here && offset ? std::optional(*here + *offset - to) : std::nullopt;
    here = to;
  }
  if (!values.has_any(linear_axes)) refuse("G92 without an axis");
  state_.saved_g92 = state_.g92;
  put_("G92" + words_of(values));
}

void OffsetCodes::set_offsets(int code) {
  const Triple wanted = code == 923 ? state_.saved_g92 : no_offset;
  if (code == 921) state_.saved_g92 = no_offset;
  std::string words;
  if (state_.g52 && code != 923) {
    put_("G52X0.Y0.Z0.");
  } else {
    words = words_to_offsets(code, wanted);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) state_.shift(axis, state_.g92[axis], wanted[axis]);
  state_.g92 = wanted;
  state_.g52 = false;
  if (!words.empty()) put_("G92" + words);
}

std::string OffsetCodes::words_to_offsets(int code, const Triple& wanted) const {
  std::array<std::optional<double>, 3> to;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::optional<double> before = state_.g92[axis];
    const std::optional<double> here = state_.position[axis];
    if (before && before == wanted[axis]) continue;
    if (!before || !wanted[axis] || !here) {
      refuse(
          fmt::format("G92.{}: the position of {} was not known at G92 or is not known here, so that the offset is not",
                      code % 10, upper(axis_letters[axis])));
    }
    to[axis] = (*here + *before - *wanted[axis]) / state_.unit_mm();
  }
  return dialect::axis_words(to);
}

void OffsetCodes::data(const WordValues& values) {
  const double kind = values.get('l', -1.0);
  const std::int64_t number = truncated(values.get('p', 0.0));
  if (kind == 1.0) {
    tool_data(values, number);
    return;
  }
  if (kind != 2.0 && kind != 20.0) refuse(fmt::format("G10 L{:g} is not read; L1, L2 and L20 are", kind));
  const std::int64_t system = number != 0 ? number : state_.modes.system;
  if (system < 1 || system > 9) {
    refuse(fmt::format("G10 L{:g} P{}: P is 1 to 9, or 0 for the system in force", kind, number));
  }
  if (kind == 2.0 && values.get('r', 0.0) != 0.0) {
    refuse("G10 L2 R turns the work coordinate system: it is not read");
  }
  std::array<std::optional<double>, 3> written;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!values.has(axis_letters[axis])) continue;
    double value = values[axis_letters[axis]] * state_.unit_mm();
    if (kind == 20.0) value = offset_so_that(axis, value);
    std::optional<double>& offset = state_.offsets(system)[axis];
    if (system == state_.modes.system) state_.shift(axis, offset, value);
    offset = value;
    written[axis] = value / state_.unit_mm();
  }
  const std::string words = dialect::axis_words(written);
  if (words.empty()) return;
  put_in_absolute((system <= 6 ? fmt::format("G10L2P{}", system) : fmt::format("G10L20P{}", system - 6)) + words);
}

void OffsetCodes::tool_data(const WordValues& values, std::int64_t number) {
  if (number <= 0) refuse("G10 L1 needs P, the number of a tool");
  refuse_x_and_y("G10 L1", values);
  if (values.has('z')) {
    state_.lengths[number] = values['z'] * state_.unit_mm();
    put_in_absolute(fmt::format("G10L10P{}R{}", number, number_text(values['z'])));
  }
  if (values.has('r')) put_in_absolute(fmt::format("G10L12P{}R{}", number, number_text(values['r'])));
}

double OffsetCodes::offset_so_that(std::size_t axis, double value) {
  const std::optional<double> here = state_.position[axis];
  const std::optional<double> own = state_.offsets(state_.modes.system)[axis];
  if (!here || !own) {
    refuse(fmt::format("G10 L20: the position of {} or the offset of {} is not known (input.work_offsets)",
                       upper(axis_letters[axis]), system_words(state_.modes.system)));
  }
  return *own + *here - value;
}

}  // namespace shapegcode::linuxcnc
