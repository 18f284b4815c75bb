// Codes that change the modal state or the known position.
#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "path/arc_frame.hpp"
#include "program/interpret/interpreter_impl.hpp"

namespace shapegcode::detail {

// Whether a '/' block runs is the operator's choice: whatever it may change is not known afterwards.
void Interpreter::optional_skip_block(const ModalState& before) {
  std::uint32_t changed = 0;
  const auto differ = [&](int a, int b, Group group) {
    if (a != b) {
      changed |= bit(group);
    }
  };
  differ(before.motion, state_.motion, Group::motion);
  differ(before.plane, state_.plane, Group::plane);
  differ(before.distance, state_.distance, Group::distance);
  differ(before.feed_mode, state_.feed_mode, Group::feed_mode);
  differ(before.units, state_.units, Group::units);
  differ(before.compensation, state_.compensation, Group::compensation);
  differ(before.length_offset, state_.length_offset, Group::length_offset);
  differ(before.cycle, state_.cycle, Group::cycle);
  differ(before.cycle_return, state_.cycle_return, Group::cycle_return);
  differ(before.coordinate_system, state_.coordinate_system, Group::coordinates);
  differ(before.exact_stop, state_.exact_stop, Group::exact_stop);
  if (before.feed != state_.feed) {
    changed |= feed_bit;
  }
  if (changed != 0) {
    warn("block skip '/' changes the modal state: nothing is shaped until that group is given again");
  }
  state_.uncertain_groups |= changed | before.uncertain_groups;
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    if (before.position_mm[i] != state_.position_mm[i] || before.known[axis] != state_.known[axis]) {
      state_.known[axis] = false;
    }
  }
}

void Interpreter::read_codes(LineFlow& flow) {
  explicit_exact_stop_ = false;
  one_shot_axes_ = false;
  for (int k = 0; k < words().g_count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    read_code(words().g_tenths[i], words().g_group[i], words().g_column[i], flow);
  }
  if (words().has('H') && (words().groups & group_bit(Group::length_offset)) == 0 && state_.length_offset != 49 &&
      (words().groups & group_bit(Group::none)) == 0) {
    length_offset(state_.length_offset);  // H alone changes the offset in force
  }
}

// Where the state of a group is kept that one number describes.
int* Interpreter::modal_field(Group group) noexcept {
  switch (group) {
    case Group::motion:
      return &state_.motion;
    case Group::plane:
      return &state_.plane;
    case Group::distance:
      return &state_.distance;
    case Group::feed_mode:
      return &state_.feed_mode;
    case Group::units:
      return &state_.units;
    case Group::compensation:
      return &state_.compensation;
    case Group::cycle_return:
      return &state_.cycle_return;
    case Group::exact_stop:
      return &state_.exact_stop;
    default:
      return nullptr;
  }
}

void Interpreter::compensation_code(int whole) noexcept {
  if (whole == 40 && state_.compensation != 40) {
    // The tool leaves the offset with the next move of the plane; until then its position is not the programmed.
    const ArcFrame plane(plane_normal(state_.plane));
    for (int i : {plane.a, plane.b}) {
      state_.known[static_cast<std::size_t>(i)] = false;
    }
  }
}

void Interpreter::cycle_code(int whole) {
  if (whole != 80 && state_.cycle == 80) {
    cycle_ = CannedCycle{};
    cycle_.clearance_mm = options_.peck_clearance_mm;
    cycle_.initial_mm = state_.position_mm[plane_normal(state_.plane)];
    cycle_.r_mm = cycle_.bottom_mm = cycle_.initial_mm;
    cycle_.has_r = cycle_.has_bottom = false;
  }
  state_.cycle = whole;
}

// G54 ... G59, G54.1.
void Interpreter::coordinate_code(int g_tenths, LineFlow& flow) {
  // G54 P7 is G54.1 P7; in a block with a dwell or a cycle P belongs to that.
  const bool extended = g_tenths == 541 || (g_tenths == 540 && words().has('P') && state_.cycle == 80 &&
                                            (words().groups & (group_bit(Group::none) | group_bit(Group::cycle))) == 0);
  const int system = extended ? 541 : g_tenths / 10;
  const int extra = !extended ? 0 : words().has('P') ? static_cast<int>(words()['P'].value) : 1;
  if (extended && (extra < 1 || extra > 300)) {
    alarm(30, fmt::format("G54.1 P{}: P is 1 ... 300", extra), words()['P'].column);
  }
  if (system != state_.coordinate_system || extra != state_.coordinate_number) {
    change_coordinates(system, extra);
    flow.stop = true;
  }
  state_.coordinate_system = system;
  state_.coordinate_number = extra;
}

// G27 ... G31: where they end is the machine's business.
void Interpreter::reference_code(int g_tenths) {
  if (g_tenths == 270 || g_tenths == 290) {
    refuse_in_cycle(g_tenths);
  }
  one_shot_axes_ = true;
  unknown_move(words().has_any(axis_letters) ? words().present : axis_letters, false);
  if (words().has_any(axis_letters)) {
    forget_axes(words().present);
  } else {
    forget_all();
  }
  warn(g_code_name(g_tenths) + " is passed through untouched: position not known afterwards");
}

void Interpreter::read_code(int g_tenths, Group group, std::uint32_t column, LineFlow& flow) {
  const int whole = g_tenths / 10;
  if (int* const field = modal_field(group)) {
    const bool changes = *field != whole;
    const bool keeps_region =
        group == Group::motion || group == Group::plane || group == Group::distance || group == Group::feed_mode;
    // A no-op (G40 where nothing is compensated) leaves a block inside its region; a change ends it.
    flow.stop = flow.stop || (changes && !keeps_region);
    if (group == Group::motion && state_.cycle != 80) {
      state_.cycle = 80;
      flow.stop = true;
    }
    distance_given_ = distance_given_ || group == Group::distance;
    units_given_ = units_given_ || group == Group::units;
    if (group == Group::feed_mode && changes) {
      state_.feed = 0.0;  // the old F has another unit
    }
    if (group == Group::compensation) {
      compensation_code(whole);
    }
    *field = whole;
    state_.uncertain_groups &= ~bit(group);
    return;
  }
  switch (group) {
    case Group::length_offset:
      flow.stop = flow.stop || whole != state_.length_offset || words().has('H');
      length_offset(whole);
      state_.uncertain_groups &= ~bit(group);
      return;
    case Group::cycle:
      flow.stop = true;
      cycle_code(whole);
      state_.uncertain_groups &= ~bit(group);
      return;
    case Group::coordinates:
      coordinate_code(g_tenths, flow);
      state_.uncertain_groups &= ~bit(group);
      return;
    case Group::none:
      one_shot(g_tenths, flow);
      return;
    case Group::foreign:
      flow.stop = true;
      foreign_switch(g_tenths);
      return;
    case Group::harmless:
      look_ahead_switch(g_tenths);
      flow.stop = true;
      one_shot_axes_ = one_shot_axes_ || g_tenths == 220;  // the others may share their block with a move
      return;
    case Group::unknown_position:
      flow.stop = true;
      reference_code(g_tenths);
      return;
    case Group::refused:
      fail(g_code_name(g_tenths) + ": cylindrical interpolation is not supported", column);
    default:
      alarm(10, "unknown G code " + g_code_name(g_tenths), column);
  }
}

void Interpreter::dwell() {
  double seconds = 0.0;
  const Word* time = nullptr;
  if (words().has('P')) {
    const Word& p = words()['P'];
    if (p.has_point) {
      alarm(7, "G04 P takes whole milliseconds: no decimal point", p.column);
    }
    seconds = p.value * 1e-3;
    time = &p;
  } else if (words().has('X') || words().has('U')) {
    const Word& x = words()[words().has('X') ? 'X' : 'U'];
    seconds = x.has_point || options_.calculator_decimal_point ? x.value : x.value * 1e-3;
    time = &x;
  } else {
    warn("G04 without P (milliseconds) or X (seconds): a stop, no dwell");
    close_region();
    return;
  }
  if (seconds < 0.0) {
    alarm(6, fmt::format("dwell G04 {}{} is negative", time->letter, time->value), time->column);
  }
  add_move({make_line(state_.position_mm, state_.position_mm, 0.0, line_number_), seconds});
}

void Interpreter::one_shot(int g_tenths, LineFlow& flow) {
  switch (g_tenths) {
    case 90:
      explicit_exact_stop_ = true;
      flow.stop = flow.stop || !words().has_any(axis_letters | centre_letters);
      return;
    case 40:
      flow.stop = true;
      one_shot_axes_ = true;
      dwell();
      return;
    case 100:
      flow.stop = true;
      one_shot_axes_ = true;
      data_setting();
      return;
    case 920:
      flow.stop = true;
      one_shot_axes_ = true;
      for (int axis = 0; axis < axis_count; ++axis) {
        const char letter = static_cast<char>('X' + axis);
        if (words().has(letter)) {
          state_.position_mm[axis] = length_mm(words()[letter]);
          state_.known[static_cast<std::size_t>(axis)] = true;
        }
      }
      return;
    case 520:
      flow.stop = true;
      one_shot_axes_ = true;
      for (int axis = 0; axis < axis_count; ++axis) {
        const char letter = static_cast<char>('X' + axis);
        if (words().has(letter)) {
          const double offset = length_mm(words()[letter]);
          state_.position_mm[axis] -= offset - local_offset_[axis];
          local_offset_[axis] = offset;
          // Behind a G52 that may not have run the step from the old offset is not known.
          const auto i = static_cast<std::size_t>(axis);
          state_.known[i] = state_.known[i] && !local_offset_uncertain_[i];
          local_offset_uncertain_[i] = block_->optional_skip;
        }
      }
      return;
    default:  // G28, G30, G53: machine coordinates
      if (g_tenths != 530) {
        refuse_in_cycle(g_tenths);
      }
      if (g_tenths == 300 && words().has('P') && (words()['P'].value < 2.0 || words()['P'].value > 4.0)) {
        alarm(46, fmt::format("G30 P{}: the reference points are P2, P3 and P4", words()['P'].value),
              words()['P'].column);
      }
      flow.stop = true;
      one_shot_axes_ = true;
      forget_axes(words().present);
      return;
  }
}

void Interpreter::foreign_switch(int g_tenths) {
  std::uint32_t mode = 0;
  bool on = true;
  const char* name = "";
  switch (g_tenths) {
    case 121:
    case 131:
      mode = 32;
      on = g_tenths == 121;
      name = "polar interpolation G12.1";
      break;
    default:
      mode = 4;
      name = "tool axis offset G43.x";
      state_.known[2] = false;
  }
  // G13.1 has no axis words of its own: X Y Z beside it are a move.
  one_shot_axes_ = one_shot_axes_ || on;
  if (on && (foreign_ & mode) == 0) {
    warn(std::string(name) + " is not supported yet: passed through untouched until it is cancelled");
  }
  if (on || (foreign_ & mode) != 0) {
    forget_all();
  }
  foreign_ = on ? foreign_ | mode : foreign_ & ~mode;
}

// G05.1 Q1, G08 P1 and G05 P10000 switch modes on that plan short blocks again.
void Interpreter::look_ahead_switch(int g_tenths) {
  if (g_tenths == 51 && words().has('Q')) {
    look_ahead_ = words()['Q'].value != 0.0;
  } else if ((g_tenths == 80 || g_tenths == 50) && words().has('P')) {
    look_ahead_ = words()['P'].value != 0.0;
  }
}

void Interpreter::change_coordinates(int number, int extra) {
  const AxisOffsets before = offsets_.work(state_.coordinate_system, state_.coordinate_number);
  const AxisOffsets after = offsets_.work(number, extra);
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    if (before[axis] && after[axis]) {
      state_.position_mm[static_cast<Eigen::Index>(axis)] += *before[axis] - *after[axis];
    } else {
      state_.known[axis] = false;
    }
  }
}

namespace {

bool ends_something(int code) noexcept { return code <= 2 || code == 5 || code == 9 || code == 30; }

}  // namespace

void Interpreter::m_codes(LineFlow& flow) {
  if (words().has_any(letter_mask("MST"))) {
    close_region();
    MachineFunction function;
    function.m_codes = words().m_codes;
    function.m_count = words().m_count;
    const auto codes = std::span(function.m_codes).first(static_cast<std::size_t>(function.m_count));
    const auto changes = static_cast<double>(std::ranges::count(codes, 6));
    const double other = static_cast<double>(function.m_count) - changes;
    require_room(work_.wait(changes * options_.limits.tool_change_s + other * options_.limits.m_function_s, "block"));
    if (words().has('T')) {
      function.tool = static_cast<std::int64_t>(words()['T'].value);
    }
    if (words().has('S')) {
      function.spindle_rev_per_min = words()['S'].value;
    }
    add_step(StepKind::function, program_.functions.size());
    program_.functions.push_back(function);
    // The spindle, the coolant and the like start with the block's move, what ends something follows it.
    if (std::ranges::none_of(codes, ends_something)) {
      const auto moves =
          std::find_if(program_.steps.begin() + static_cast<std::ptrdiff_t>(steps_before_block_), program_.steps.end(),
                       [](const ProgramStep& step) { return step.kind != StepKind::region; });
      std::rotate(moves, program_.steps.end() - 1, program_.steps.end());
    }
  }
  for (int k = 0; k < words().m_count; ++k) {
    flow.stop = true;
    switch (words().m_codes[static_cast<std::size_t>(k)]) {
      case 2:
      case 30:
        close_region();
        ended_ = ended_ || !block_->optional_skip;
        break;
      case 6:
        for (std::size_t axis = 0; axis < axis_count; ++axis) {
          if (options_.unknown_after_tool_change[axis]) {
            state_.known[axis] = false;
          }
        }
        break;
      default:
        break;
    }
  }
}

}  // namespace shapegcode::detail
