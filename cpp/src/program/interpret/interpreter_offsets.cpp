// Offsets: tool length, and data setting by G10.
#include <fmt/format.h>

#include "program/interpret/interpreter_impl.hpp"

namespace shapegcode::detail {

// G43 adds the offset of H to Z, G44 takes it away; the tip's coordinate shifts by the difference, where both are
// known.
void Interpreter::length_offset(int whole) {
  const int number = whole == 49 ? 0 : words().has('H') ? static_cast<int>(words()['H'].value) : state_.length_number;
  const auto shift = [&](int code, int h) -> std::optional<double> {
    const auto value = code == 49 ? std::optional<double>(0.0) : offsets_.length(h);
    return value && code == 44 ? std::optional<double>(-*value) : value;
  };
  const auto before = shift(state_.length_offset, state_.length_number);
  const auto after = shift(whole, number);
  if (whole != state_.length_offset || (whole != 49 && number != state_.length_number)) {
    if (before && after) {
      state_.position_mm[2] += *before - *after;
    } else {
      state_.known[2] = false;
    }
  }
  if (whole == 49) {
    foreign_ &= ~4U;
  } else {
    state_.length_number = number;
  }
  state_.length_offset = whole;
}

// G10: offsets by program. What it sets is known from then on.
void Interpreter::data_setting() {
  const int kind = words().has('L') ? static_cast<int>(words()['L'].value) : -1;
  const int number = words().has('P') ? static_cast<int>(words()['P'].value) : 0;
  switch (kind) {
    case 2:
      if (number < 0 || number > 6) {
        alarm(31, fmt::format("G10 L2 P{}: P is 1 ... 6 for G54 ... G59, or 0", number), words()['P'].column);
      }
      if (number == 0) {
        forget_all();  // the external offset moves every system
        warn("G10 L2 P0 shifts all work offsets: position not known afterwards");
        return;
      }
      data_work_offset(53 + number, 0);
      return;
    case 20:
      if (number < 1 || number > 300) {
        alarm(31, fmt::format("G10 L20 P{}: P is 1 ... 300 for G54.1 P1 ... P300", number),
              words().has('P') ? words()['P'].column : 0);
      }
      data_work_offset(541, number);
      return;
    case -1:
    case 1:
    case 3:
    case 10:
    case 11:
    case 12:
    case 13:
      if (kind != 3 && words().has('P') && words().has('R')) {
        set_tool_offset(kind);
        return;
      }
      if (kind >= 10) {
        const bool value = words().has('P');
        alarm(value ? 32 : 31,
              fmt::format("G10 L{}{}", kind, value ? " without a value R" : " without an offset number P"));
      }
      break;
    case 50:
    case 52:
      break;
    default:
      alarm(31, fmt::format("G10 L{} is not known", kind), words()['L'].column);
  }
  if (kind == -1 || kind == 50 || kind == 52 || kind == 3) {
    return;  // parameters, tool life: nothing that moves an axis
  }
  forget_all();
  warn("G10 is passed through untouched: position not known afterwards");
}

void Interpreter::data_work_offset(int coordinate_system, int number) {
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    if (words().has(letter)) {
      set_work_offset(coordinate_system, number, axis, length_mm(words()[letter]), state_.distance == 91);
    }
  }
}

void Interpreter::set_work_offset(int coordinate_system, int number, int axis, double value_mm, bool incremental) {
  const auto i = static_cast<std::size_t>(axis);
  const std::optional<double> before = offsets_.work(coordinate_system, number)[i];
  std::optional<double> after;
  if (!incremental) {
    after = value_mm;
  } else if (before) {
    after = *before + value_mm;
  }
  if (coordinate_system == state_.coordinate_system && number == state_.coordinate_number) {
    if (incremental) {
      state_.position_mm[axis] -= value_mm;
    } else if (before) {
      state_.position_mm[axis] -= value_mm - *before;
    } else {
      state_.known[i] = false;
    }
  }
  offsets_.set_work(coordinate_system, number, axis, after);
}

void Interpreter::set_tool_offset(int kind) {
  const int number = static_cast<int>(words()['P'].value);
  if (number < 1 || number > 999) {
    alarm(30, fmt::format("G10: offset number P{} outside 1 ... 999", number), words()['P'].column);
  }
  ToolOffset offset = offsets_.tool(number);
  const double value = length_mm(words()['R']);
  const auto set = [&](std::optional<double>& field) {
    field = state_.distance == 91 ? (field ? std::optional<double>(*field + value) : std::nullopt) : value;
  };
  // Memory A has one value for length and radius, B geometry and wear, C both for length (H) and radius (D).
  const bool one = options_.offset_memory == 'A';
  const bool shared = options_.offset_memory != 'C';
  if (one || kind == 10 || (shared && kind != 11)) {
    set(offset.length_mm);
    if (shared) {
      offset.radius_mm = offset.length_mm;
    }
  } else if (kind == 11 || kind == 1 || kind == -1) {
    set(offset.length_wear_mm);
    if (shared) {
      offset.radius_wear_mm = offset.length_wear_mm;
    }
  } else if (kind == 12) {
    set(offset.radius_mm);
  } else if (kind == 13) {
    set(offset.radius_wear_mm);
  }
  offsets_.set_tool(number, offset);
  if (state_.length_offset != 49 && state_.length_number == number) {
    state_.known[2] = false;  // whether the new value acts at once depends on the control
  }
}

// G27 ... G30 while a drilling cycle is on.
void Interpreter::refuse_in_cycle(int g_tenths) const {
  if (state_.cycle == 80) {
    return;
  }
  std::uint32_t column = 1;
  for (int k = 0; k < words().g_count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    column = words().g_tenths[i] == g_tenths ? words().g_column[i] : column;
  }
  alarm(44, fmt::format("G{} while the drilling cycle G{} is on: cancel it with G80", g_tenths / 10, state_.cycle),
        column);
}

}  // namespace shapegcode::detail
