// Codes that change the modal state or what is known of the position.
#include "interpreter_impl.hpp"

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
  for (int k = 0; k < words_.g_count; ++k) {
    const int g = words_.g_tenths[static_cast<std::size_t>(k)];
    const std::uint32_t column = words_.g_column[static_cast<std::size_t>(k)];
    const int whole = g / 10;
    const Group group = detail::group_of(g);
    // A no-op (G40 where nothing is compensated) leaves a block inside its region; a change ends it.
    const auto set = [&](int& field, bool keeps_region) {
      if (field != whole && !keeps_region) {
        flow.stop = true;
      }
      field = whole;
      state_.uncertain_groups &= ~bit(group);
    };
    switch (group) {
      case Group::motion:
        set(state_.motion, true);
        if (state_.cycle != 80) {
          state_.cycle = 80;
          flow.stop = true;
        }
        break;
      case Group::plane:
        set(state_.plane, true);
        break;
      case Group::distance:
        set(state_.distance, true);
        distance_given_ = true;
        break;
      case Group::feed_mode:
        if (whole != state_.feed_mode) {
          state_.feed = 0.0;  // the old F has another unit
        }
        set(state_.feed_mode, true);
        break;
      case Group::units:
        set(state_.units, false);
        break;
      case Group::compensation:
        if (whole == 40 && state_.compensation != 40) {
          // The tool leaves the offset with the next move of the plane; until then its position is not the programmed.
          const int normal = plane_normal(state_.plane);
          for (int i : {(normal + 1) % 3, (normal + 2) % 3}) {
            state_.known[static_cast<std::size_t>(i)] = false;
          }
        }
        if (whole != 40 && state_.compensation == 40) {
          warn("cutter compensation G" + std::to_string(whole) + " is not supported yet: passed through untouched");
        }
        set(state_.compensation, false);
        break;
      case Group::length_offset: {
        const int number = words_.has('H') ? static_cast<int>(words_['H'].value) : state_.length_number;
        if (whole != state_.length_offset || (whole != 49 && number != state_.length_number)) {
          flow.stop = true;
          state_.known[2] = false;
        }
        if (whole == 49) {
          foreign_ &= ~4U;
        }
        set(state_.length_offset, false);
        break;
      }
      case Group::cycle:
        flow.stop = true;
        if (whole == 80) {
          state_.cycle = 80;
        } else {
          if (state_.cycle == 80) {
            cycle_ = CannedCycle{};
            cycle_.initial_mm = state_.position_mm[plane_normal(state_.plane)];
          }
          state_.cycle = whole;
        }
        state_.uncertain_groups &= ~bit(Group::cycle);
        break;
      case Group::cycle_return:
        set(state_.cycle_return, false);
        break;
      case Group::coordinates:
        if (whole != state_.coordinate_system) {
          change_coordinates(whole);
        }
        set(state_.coordinate_system, false);
        break;
      case Group::exact_stop:
        set(state_.exact_stop, false);
        break;
      case Group::none:
        one_shot(g, flow);
        break;
      case Group::foreign:
        flow.stop = true;
        foreign_switch(g);
        break;
      case Group::harmless:
        look_ahead_switch(g);
        flow.stop = true;
        one_shot_axes_ = one_shot_axes_ || g == 220;  // the others may share their block with a move
        break;
      case Group::unknown_position:
        flow.stop = true;
        if (g == 541) {  // G54.1 leaves G54 ... G59; X Y Z beside it are a move
          state_.coordinate_system = g;
          state_.uncertain_groups &= ~bit(Group::coordinates);
        } else {
          one_shot_axes_ = true;
        }
        if (words_.has_any(axis_letters) && g != 100 && g != 541) {
          forget_axes(words_.present);
        } else {
          forget_all();
        }
        warn("G" + std::to_string(whole) + (g % 10 != 0 ? "." + std::to_string(g % 10) : "") +
             " is passed through untouched: position not known afterwards");
        break;
      case Group::refused:
        fail("G" + std::to_string(whole) + (g % 10 != 0 ? "." + std::to_string(g % 10) : "") +
                 " is not supported yet (macro call or cylindrical interpolation)",
             column);
      case Group::invalid:
      default:
        fail("unknown G code G" + std::to_string(whole) + (g % 10 != 0 ? "." + std::to_string(g % 10) : ""), column);
    }
  }
  if (words_.has('H')) {
    const int number = static_cast<int>(words_['H'].value);
    if (state_.length_offset != 49 && number != state_.length_number) {
      state_.known[2] = false;
    }
    state_.length_number = number;
  }
}

void Interpreter::one_shot(int g_tenths, LineFlow& flow) {
  switch (g_tenths) {
    case 90:
      explicit_exact_stop_ = true;
      flow.stop = flow.stop || !words_.has_any(axis_letters | centre_letters);
      return;
    case 40: {
      flow.stop = true;
      one_shot_axes_ = true;
      double seconds = 0.0;
      if (words_.has('P')) {
        const Word& p = words_['P'];
        if (p.has_point) {
          fail("G04 P takes whole milliseconds: no decimal point (alarm 0007)", p.column);
        }
        seconds = p.value * 1e-3;
      } else if (words_.has('X')) {
        const Word& x = words_['X'];
        seconds = x.has_point || options_.calculator_decimal_point ? x.value : x.value * 1e-3;
      } else {
        fail("G04 needs P (milliseconds) or X (seconds)");
      }
      if (seconds < 0.0) {
        fail("dwell G04 is negative");
      }
      add_move({make_line(state_.position_mm, state_.position_mm, 0.0, line_number_), seconds});
      return;
    }
    case 920:
      flow.stop = true;
      one_shot_axes_ = true;
      for (int axis = 0; axis < axis_count; ++axis) {
        const char letter = static_cast<char>('X' + axis);
        if (words_.has(letter)) {
          state_.position_mm[axis] = length_mm(words_[letter]);
          state_.known[static_cast<std::size_t>(axis)] = true;
        }
      }
      return;
    case 520:
      flow.stop = true;
      one_shot_axes_ = true;
      for (int axis = 0; axis < axis_count; ++axis) {
        const char letter = static_cast<char>('X' + axis);
        if (words_.has(letter)) {
          const double offset = length_mm(words_[letter]);
          state_.position_mm[axis] -= offset - local_offset_[axis];
          local_offset_[axis] = offset;
          // Behind a G52 that may not have run the step from the old offset is not known.
          const auto i = static_cast<std::size_t>(axis);
          state_.known[i] = state_.known[i] && !local_offset_uncertain_[i];
          local_offset_uncertain_[i] = block_.optional_skip;
        }
      }
      return;
    default:  // G28, G30, G53: machine coordinates
      flow.stop = true;
      one_shot_axes_ = true;
      forget_axes(words_.present);
      return;
  }
}

void Interpreter::foreign_switch(int g_tenths) {
  std::uint32_t mode = 0;
  bool on = true;
  const char* name = "";
  switch (g_tenths) {
    case 150:
    case 160:
      mode = 1;
      on = g_tenths == 160;
      name = "polar coordinates G16";
      break;
    case 500:
    case 510:
      mode = 2;
      on = g_tenths == 510;
      name = "scaling G51";
      break;
    case 501:
    case 511:
      mode = 8;
      on = g_tenths == 511;
      name = "mirror G51.1";
      break;
    case 680:
    case 690:
      mode = 16;
      on = g_tenths == 680;
      name = "rotation G68";
      break;
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
  // G69, G50, G15, G13.1 have no axis words of their own: X Y Z beside them are a move. G50.1 has.
  one_shot_axes_ = one_shot_axes_ || on || g_tenths == 501;
  if (on && (foreign_ & mode) == 0) {
    warn(std::string(name) + " is not supported yet: passed through untouched until it is cancelled");
  }
  if (on || (foreign_ & mode) != 0) {
    forget_all();
  }
  foreign_ = on ? foreign_ | mode : foreign_ & ~mode;
}

// G05.1 Q1, G08 P1 and G05 P10000 switch modes on that plan short blocks anew.
void Interpreter::look_ahead_switch(int g_tenths) {
  if (g_tenths == 51 && words_.has('Q')) {
    look_ahead_ = words_['Q'].value != 0.0;
  } else if ((g_tenths == 80 || g_tenths == 50) && words_.has('P')) {
    look_ahead_ = words_['P'].value != 0.0;
  }
}

void Interpreter::change_coordinates(int number) {
  const auto& offsets = options_.work_offsets_mm;
  const auto index = [](int g) { return static_cast<std::size_t>(g - 54); };
  if (index(number) < offsets.size() && index(state_.coordinate_system) < offsets.size()) {
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      state_.position_mm[static_cast<Eigen::Index>(axis)] +=
          offsets[index(state_.coordinate_system)][axis] - offsets[index(number)][axis];
    }
  } else {
    forget_all();
  }
}

void Interpreter::m_codes(LineFlow& flow) {
  if (words_.has_any(letter_mask("MST"))) {
    close_region();
    MachineFunction function;
    function.m_codes = words_.m_codes;
    function.m_count = words_.m_count;
    if (words_.has('T')) {
      function.tool = static_cast<std::int64_t>(words_['T'].value);
    }
    if (words_.has('S')) {
      function.spindle_rev_per_min = words_['S'].value;
    }
    add_step(StepKind::function, program_.functions.size());
    program_.functions.push_back(function);
  }
  for (int k = 0; k < words_.m_count; ++k) {
    flow.stop = true;
    switch (words_.m_codes[static_cast<std::size_t>(k)]) {
      case 2:
      case 30:
        close_region();
        ended_ = ended_ || !block_.optional_skip;
        break;
      case 6:
        for (std::size_t axis = 0; axis < axis_count; ++axis) {
          if (options_.unknown_after_tool_change[axis]) {
            state_.known[axis] = false;
          }
        }
        break;
      case 98:
      case 99:
      case 198:
        fail("subprograms (M" + std::to_string(words_.m_codes[static_cast<std::size_t>(k)]) + ") are not supported yet",
             words_['M'].column);
      default:
        break;
    }
  }
}

}  // namespace shapegcode::detail
