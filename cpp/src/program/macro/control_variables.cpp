// System variables of custom macro B, as far as they are known before the program runs.
#include <fmt/format.h>

#include <cmath>

#include "program/read/reader_impl.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

// A value that only the control has.
bool unknown(int number) {
  throw UnknownValue(number, fmt::format("system variable #{} is known to the control only", number));
}

double code_number(int code) { return code > 100 ? code / 10.0 : code; }

}  // namespace

double ControlVariables::to_program_units(double value_mm) const {
  return value_mm / unit_mm(rewriter_.programmed().units);
}

// #4001 ...: the modal state behind the block before; #4201 ... and #4301 ... are the same here.
bool ControlVariables::modal(int number, MacroValue& value) const {
  const ModalState& state = rewriter_.programmed();
  switch (number % 100 + 4000) {
    case 4001:
      value = state.motion;
      return true;
    case 4002:
      value = state.plane;
      return true;
    case 4003:
      value = state.distance;
      return true;
    case 4005:
      value = state.feed_mode;
      return true;
    case 4006:
      value = state.units;
      return true;
    case 4007:
      value = rewriter_.compensation();
      return true;
    case 4008:
      value = state.length_offset;
      return true;
    case 4009:
      value = state.cycle;
      return true;
    case 4010:
      value = state.cycle_return;
      return true;
    case 4011:
      value = rewriter_.modes().scaling ? 51.0 : 50.0;
      return true;
    case 4012:
      value = modal_call;
      return true;
    case 4014:
      value = code_number(state.coordinate_system);
      return true;
    case 4015:
      value = state.exact_stop;
      return true;
    case 4016:
      value = rewriter_.modes().rotation ? 68.0 : 69.0;
      return true;
    case 4018:
      value = rewriter_.polar() ? 16.0 : 15.0;
      return true;
    default:
      return false;
  }
}

bool ControlVariables::work_slot(int number, int& system, int& extra, int& axis) const {
  if (number >= 5221 && number <= 5323) {
    system = 54 + (number - 5221) / 20;
    extra = 0;
    axis = (number - 5221) % 20;
    return axis < axis_count;
  }
  if (number >= 7001 && number <= 7943) {
    system = 541;
    extra = 1 + (number - 7001) / 20;
    axis = (number - 7001) % 20;
    return axis < axis_count;
  }
  return false;
}

// Tool offsets: #2001 ... and #10001 ...; what they hold depends on the offset memory.
std::optional<double>* ControlVariables::tool_field(int number, ToolOffset& offset, int& tool) const {
  int bank = -1;
  if (number >= 2001 && number <= 2800) {
    bank = (number - 2001) / 200;
    tool = (number - 2001) % 200 + 1;
  } else if (number >= 10001 && number <= 13999 && number % 1000 != 0) {
    bank = (number - 10001) / 1000;
    tool = number % 1000;
  } else {
    return nullptr;
  }
  offset = interpreter_.offsets().tool(tool);
  const char memory = options_.offset_memory;
  if ((memory == 'A' && bank > 0) || (memory == 'B' && bank > 1)) {
    return nullptr;
  }
  if (memory == 'A') {
    return &offset.length_mm;
  }
  switch (bank) {
    case 0:
      return &offset.length_wear_mm;
    case 1:
      return &offset.length_mm;
    case 2:
      return &offset.radius_wear_mm;
    default:
      return &offset.radius_mm;
  }
}

// What the program itself has reported last.
bool ControlVariables::last_reported(int number, MacroValue& value) const {
  const ModalState& state = rewriter_.programmed();
  switch (number >= 4200 && number < 4400 ? 4100 + number % 100 : number) {
    case 4107:
      value = std::max(0, rewriter_.radius_number());
      return true;
    case 4109:
      value = state.feed;
      return true;
    case 4111:
      value = state.length_number;
      return true;
    case 4113:
      value = static_cast<double>(last_m);
      return true;
    case 4114:
      value = static_cast<double>(last_n);
      return true;
    case 4115:
      value = static_cast<double>(program);
      return true;
    case 4119:
      value = state.spindle_rev_per_min;
      return true;
    case 4120:
      value = static_cast<double>(last_t);
      return true;
    case 4130:
      value = state.coordinate_number;
      return true;
    default:
      return false;
  }
}

// Work and tool offsets.
bool ControlVariables::offset(int number, MacroValue& value) const {
  int system = 0;
  int extra = 0;
  int axis = 0;
  if (work_slot(number, system, extra, axis)) {
    const auto work = interpreter_.offsets().work(system, extra)[static_cast<std::size_t>(axis)];
    if (!work) {
      return unknown(number);
    }
    value = to_program_units(*work);
    return true;
  }
  ToolOffset tool_offset;
  int tool = 0;
  if (const std::optional<double>* field = tool_field(number, tool_offset, tool)) {
    if (!*field) {
      return unknown(number);
    }
    value = to_program_units(**field);
    return true;
  }
  return false;
}

bool ControlVariables::read(int number, MacroValue& value) {
  if ((number >= 4001 && number <= 4030) || (number >= 4201 && number <= 4230) || (number >= 4301 && number <= 4330)) {
    return modal(number, value);
  }
  if (last_reported(number, value)) {
    return true;
  }
  const auto written = written_.find(number);
  if (written != written_.end()) {
    value = written->second;
    return true;
  }
  if (number == 3003 || number == 3004 || number == 3005 || number == 3007 || number == 3008) {
    value = 0.0;
    return true;
  }
  // Position behind the block before, in work coordinates, and the position commanded now: the same for a reader.
  if ((number >= 5001 && number <= 5003) || (number >= 5041 && number <= 5043)) {
    const ModalState& state = rewriter_.programmed();
    const int axis = (number - 1) % 10;
    if (!state.known[static_cast<std::size_t>(axis)]) {
      return unknown(number);
    }
    value = to_program_units(state.position_mm[axis]);
    return true;
  }
  if (offset(number, value)) {
    return true;
  }
  // Inputs, clocks, machine coordinates, measured positions: variables that exist, but not here.
  const bool exists = (number >= 1000 && number <= 1035) || (number >= 1100 && number <= 1135) ||
                      (number >= 3001 && number <= 3012) || (number >= 3901 && number <= 3902) ||
                      (number >= 5021 && number <= 5023) || (number >= 5061 && number <= 5063) ||
                      (number >= 5081 && number <= 5083) || (number >= 5201 && number <= 5203) || number == 4000;
  return exists && unknown(number);
}

bool ControlVariables::write(int number, MacroValue value) {
  const double number_mm = value.value_or(0.0) * unit_mm(rewriter_.programmed().units);
  int system = 0;
  int extra = 0;
  int axis = 0;
  if (work_slot(number, system, extra, axis)) {
    interpreter_.set_work_offset(system, extra, axis, number_mm);
    return true;
  }
  ToolOffset offset;
  int tool = 0;
  if (std::optional<double>* field = tool_field(number, offset, tool)) {
    *field = number_mm;
    if (options_.offset_memory != 'C') {
      offset.radius_mm = offset.length_mm;
      offset.radius_wear_mm = offset.length_wear_mm;
    }
    interpreter_.offsets().set_tool(tool, offset);
    return true;
  }
  const bool output = number >= 1100 && number <= 1135;
  const bool switches = number == 3000 || number == 3001 || number == 3002 || number == 3003 || number == 3004 ||
                        number == 3005 || number == 3006 || number == 3901 || number == 3902;
  if (number >= 5201 && number <= 5203) {
    interpreter_.forget_all();
    return true;
  }
  if (output || switches) {
    if (number == 3003 || number == 3004 || number == 3005) {
      written_[number] = value.value_or(0.0);
    }
    return true;
  }
  return false;
}

}  // namespace shapegcode::detail
