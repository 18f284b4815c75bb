// Axis moves: cutting regions, rapids, drilling cycles.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "program/interpret/arc_geometry.hpp"
#include "program/interpret/interpreter_impl.hpp"

namespace shapegcode::detail {

void Interpreter::check_range() const {
  const double unit = unit_mm(state_.units);
  const double limit = (state_.units == 20 ? 9999.9999 : 99999.999) * (1.0 + 1e-12);
  for (char letter : {'X', 'Y', 'Z', 'I', 'J', 'K', 'R'}) {
    if (words().has(letter) && std::abs(length_mm(words()[letter])) > limit * unit) {
      alarm(3, fmt::format("{}{:.4f} lies outside +-{:.4f}", letter, length_mm(words()[letter]) / unit, limit),
            words()[letter].column);
    }
  }
}

// Where a move ends is not known if that depends on a group that a '/' block left open.
void Interpreter::forget_uncertain_end() noexcept {
  const std::uint32_t of_cycles = bit(Group::cycle) | bit(Group::cycle_return);
  const std::uint32_t of_ends = bit(Group::distance) | bit(Group::units) | bit(Group::compensation) |
                                bit(Group::length_offset) | bit(Group::coordinates);
  if ((state_.uncertain_groups & of_cycles) != 0) {
    forget_all();
  } else if ((state_.uncertain_groups & of_ends) != 0) {
    forget_axes(words().present);
  }
}

// End point of a block from its X Y Z words. False if in G90 the block moves an axis from where it is not known.
bool Interpreter::target(Vector3& end, std::array<bool, 3>& known_after, bool& relative) const noexcept {
  bool from_known = true;
  relative = false;
  end = state_.position_mm;
  known_after = state_.known;
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    if (!words().has(letter)) {
      continue;
    }
    const auto i = static_cast<std::size_t>(axis);
    const double value = length_mm(words()[letter]);
    if (state_.distance == 90) {
      from_known = from_known && state_.known[i];
      end[axis] = value;
      known_after[i] = true;
    } else {
      relative = relative || !state_.known[i];
      end[axis] += value;
    }
  }
  // An arc moves both axes of its plane, named or not.
  for (int axis = 0; axis < axis_count && (state_.motion == 2 || state_.motion == 3); ++axis) {
    if (axis != plane_normal(state_.plane) && !state_.known[static_cast<std::size_t>(axis)]) {
      from_known = from_known && state_.distance != 90;
      relative = relative || state_.distance != 90;
    }
  }
  return from_known;
}

Segment Interpreter::cutting_segment(const Vector3& end) const {
  const std::uint32_t across = 1U << static_cast<unsigned>('I' - 'A' + plane_normal(state_.plane));
  const bool without_centre = !words().has('R') && !words().has_any(centre_letters & ~across);
  if (state_.motion == 1 || (without_centre && options_.arc_without_centre_is_line)) {
    Segment segment = make_line(state_.position_mm, end, 0.0, line_number_);
    segment.feed_mm_per_s = feed_mm_per_s(segment.length_mm);
    return segment;
  }
  ArcWords arc;
  arc.start_mm = state_.position_mm;
  arc.end_mm = end;
  arc.clockwise = state_.motion == 2;
  arc.normal = plane_normal(state_.plane);
  arc.tolerance_mm = options_.arc_tolerance_mm;
  std::uint32_t column = 0;
  if (words().has('R')) {
    arc.radius_mm = length_mm(words()['R']);
    column = words()['R'].column;
  } else {
    arc.centre_mm = options_.absolute_arc_centres ? Vector3(Vector3::Zero()) : arc.start_mm;
    bool given = false;
    for (int axis = 0; axis < axis_count; ++axis) {
      const char letter = static_cast<char>('I' + axis);
      if (words().has(letter) && axis != arc.normal) {
        arc.centre_mm[axis] += length_mm(words()[letter]);
        column = words()[letter].column;
        given = true;
      } else if (options_.absolute_arc_centres) {
        arc.centre_mm[axis] = arc.start_mm[axis];
      }
    }
    if (!given) {
      alarm(22, fmt::format("arc without R or I J K in its plane G{}", state_.plane),
            words().g_count > 0 ? words().g_column[0] : 1);
    }
  }
  Segment segment = resolve_arc(arc, 0.0, line_number_, column);
  // In G93 an arc's F counts its radius, not its length (operator's manual, inverse time feed).
  segment.feed_mm_per_s = feed_mm_per_s(segment.start_radius_mm);
  return segment;
}

void Interpreter::rapid() {
  Vector3 to;
  std::array<bool, 3> known_after{};
  bool relative = false;
  const bool measurable = target(to, known_after, relative);
  if (foreign_ == 0) {
    unknown_move(words().present, true);
    OtherMove rapid{make_line(measurable ? state_.position_mm : to, to, 0.0, line_number_), 0.0};
    rapid.segment.kind = SegmentKind::rapid;
    add_move(rapid);
    program_.move_ends.push_back({line_number_, to, known_after});
    state_.position_mm = to;
    state_.known = known_after;
  }
}

// What the unit makes of a word of this block.
std::string Interpreter::unit_example() {
  const bool inch = state_.units == 20;
  for (char letter : {'X', 'Y', 'Z', 'I', 'J', 'K', 'R'}) {
    if (!words().has(letter) || words()[letter].value == 0.0) {
      continue;
    }
    const Word& word = words()[letter];
    const double own_mm = length_mm(word);
    state_.units = inch ? 21 : 20;
    const double other_mm = length_mm(word);
    state_.units = inch ? 20 : 21;
    return inch ? fmt::format("{} is read as {:.6g} inch, and would be {:.6g} mm", block_->text_of(word), own_mm / 25.4,
                              other_mm)
                : fmt::format("{} is read as {:.6g} mm, and would be {:.6g} mm in inch", block_->text_of(word), own_mm,
                              other_mm);
  }
  return std::string("numbers are read in ") + (inch ? "inch" : "mm");
}

void Interpreter::move(LineFlow& flow, const ModalState& before, std::size_t begin, std::size_t end) {
  check_range();
  if (!distance_given_) {
    warn_once(seen_distance_, fmt::format("neither G90 nor G91 before the first move: G{} assumed (power_on.distance)",
                                          state_.distance));
  }
  if (!units_given_ && seen_units_ == 0) {
    warn_once(seen_units_, "neither G20 nor G21 before the first move: " + unit_example() + " (power_on.units)");
  }
  for (char letter : {'X', 'Y', 'Z', 'I', 'J', 'K', 'R'}) {
    if (words().has(letter) && !words()[letter].has_point && words()[letter].value != 0.0) {
      warn_once(seen_no_point_, std::string("numbers without a decimal point are read as ") +
                                    (options_.calculator_decimal_point ? "mm or inch" : "least increments") +
                                    " (controller.calculator_decimal_point)");
    }
  }
  if (state_.cycle != 80) {
    close_region();
    cycle_block();
    return;
  }
  if (state_.motion == 0) {
    close_region();
    rapid();
    return;
  }
  const char* why_kept = nullptr;
  if (flow.stop) {
    why_kept = "it shares its block with another function";
  }
  if (state_.motion == 33) {
    why_kept = "threading G33 is not supported yet";
  } else if (foreign_ != 0) {
    why_kept = "a coordinate mode that is not supported yet is on";
  } else if (state_.compensation != 40) {
    why_kept = "cutter compensation is on and not expanded";
    ++program_.kept_compensated_moves;
  } else if (state_.feed_mode == 95 && !(state_.spindle_rev_per_min > 0.0)) {
    why_kept = "feed per revolution G95, and no spindle speed S was given";
  } else if (state_.exact_stop == 63 || state_.exact_stop == 62) {
    why_kept = state_.exact_stop == 63 ? "tapping mode G63 is not supported yet"
                                       : "automatic corner override G62 is not supported yet";
  } else if (state_.uncertain_groups != 0) {
    why_kept = "the modal state depends on the block-skip switch";
  }
  cut(why_kept, before, begin, end);
}

// A cutting move that stays as it is written. Its length is known only where start and path are.
void Interpreter::keep_cut(const char* why, const Vector3& end, const std::array<bool, 3>& known_after) {
  if (options_.absolute_arc_centres && state_.motion > 1 && words().has_any(centre_letters)) {
    fail(std::string("arc with an absolute centre cannot be kept as it is: ") + why);
  }
  close_region();
  if (foreign_ == 0) {
    Vector3 to;
    std::array<bool, 3> known{};
    bool relative = false;
    const bool measurable = target(to, known, relative);
    const bool plain = state_.motion == 1 || state_.compensation != 40 || state_.motion == 33;
    const double rate = state_.feed_mode != 93 ? feed_mm_per_s(0.0) : 0.0;
    const Segment segment =
        !plain && measurable ? cutting_segment(end) : make_line(state_.position_mm, end, rate, line_number_);
    // A block that restates where the tool is, as a shaped cut in G61 begins with, is no cut of unknown path.
    const bool stays = measurable && state_.motion == 1 && state_.compensation == 40 && state_.uncertain_groups == 0 &&
                       segment.length_mm == 0.0;
    if (measurable && segment.feed_mm_per_s > 0.0 && segment.length_mm > 0.0) {
      add_move({segment, 0.0});
    } else if (!stays) {
      program_.move_ends.push_back({line_number_, end, known_after});
    }
    state_.position_mm = end;
    state_.known = known_after;
  }
  // One warning for a run of such blocks.
  if (kept_run_line_ + 1 != line_number_) {
    warn(std::string("cutting move kept untouched: ") + why);
  }
  kept_run_line_ = line_number_;
}

void Interpreter::cut(const char* why_kept, const ModalState& before, std::size_t begin, std::size_t end) {
  if (!(state_.feed > 0.0)) {
    alarm(11, words().has('F') ? "cutting move with feed F0" : "cutting move, but no feed F was given",
          words().has('F') ? words()['F'].column : 1);
  }
  Vector3 to;
  std::array<bool, 3> known_after{};
  bool relative = false;
  if (!target(to, known_after, relative) && why_kept == nullptr) {
    why_kept = "the position before it is not known";
  }
  if (why_kept != nullptr) {
    keep_cut(why_kept, to, known_after);
    return;
  }
  Segment segment = cutting_segment(to);
  const bool stops = explicit_exact_stop_ || state_.exact_stop == 61;
  if (region_ == nullptr) {
    region_ = std::make_shared<Region>();
    region_->first_line = line_number_;
    region_->text_begin = begin;
    region_->entry = before;
    region_->look_ahead_mode = look_ahead_;
    notes_kept_ = 0;
  }
  note(segments_.size());
  region_->incremental = region_->incremental || relative;
  segment.stop_at_end = stops;
  if (segment.length_mm > 0.0) {
    require_room(work_.move(segment));
    segments_.add(segment);
  }
  state_.position_mm = to;
  state_.known = known_after;
  region_->last_line = line_number_;
  region_->text_end = end;
  region_->exit = state_;
  region_->exact_stop_at_end = stops;
  ++region_->blocks;
  notes_kept_ = region_->notes.size();
  if (stops) {
    close_region();
  }
}

// Levels, depth of cut and dwell of a drilling cycle, as far as the block gives them.
void Interpreter::read_cycle_words(int axis) {
  const char depth_letter = static_cast<char>('X' + axis);
  const bool incremental = state_.distance == 91;
  // Levels are kept as levels: a row of holes in G91 behind a cycle in G90 is drilled at the same ones.
  if (words().has('R')) {
    const double value = length_mm(words()['R']);
    cycle_.r_mm = incremental ? cycle_.initial_mm + value : value;
    cycle_.has_r = true;
  } else if (!cycle_.has_r) {
    warn_once(seen_cycle_level_,
              fmt::format("drilling cycle G{} without R: R is the level at which the cycle began", state_.cycle));
  }
  if (words().has(depth_letter)) {
    const double value = length_mm(words()[depth_letter]);
    cycle_.bottom_mm = incremental ? cycle_.r_mm + value : value;
    cycle_.has_bottom = true;
  } else if (!cycle_.has_bottom) {
    warn_once(seen_cycle_depth_,
              fmt::format("drilling cycle G{} without {}: nothing is drilled", state_.cycle, depth_letter));
  }
  if (words().has('Q')) {
    cycle_.peck_mm = std::abs(length_mm(words()['Q']));
  }
  if (words().has('P')) {
    // Some post-processors write "P500.": whole milliseconds all the same.
    if (words()['P'].value != std::floor(words()['P'].value)) {
      alarm(7, fmt::format("P{} of a drilling cycle: it takes whole milliseconds", words()['P'].value),
            words()['P'].column);
    }
    if (words()['P'].has_point) {
      warn_once(seen_cycle_point_, "P of a drilling cycle counts milliseconds; some controls refuse its decimal point");
    }
    cycle_.dwell_s = words()['P'].value * 1e-3;
  }
  cycle_.code = state_.cycle;
  cycle_.return_to_r = state_.cycle_return == 99;
}

int Interpreter::cycle_repeats() const {
  int repeats = 1;
  for (char letter : {'K', 'L'}) {
    if (words().has(letter)) {
      const double count = words()[letter].value;
      if (count < 0.0) {
        alarm(6, fmt::format("minus sign in the repetitions {}{} of a drilling cycle", letter, count),
              words()[letter].column);
      }
      // A computed K carries a point ("K3."): only a fraction is wrong.
      if (count != std::floor(count)) {
        alarm(7, fmt::format("repetitions {}{} of a drilling cycle are no whole number", letter, count),
              words()[letter].column);
      }
      repeats = static_cast<int>(std::min(count, 9999.0));
    }
  }
  return repeats;
}

void Interpreter::require_cycle_data() const {
  if (!(state_.feed > 0.0)) {
    alarm(11, fmt::format("drilling cycle G{} without a feed F", state_.cycle));
  }
  if ((state_.cycle == 73 || state_.cycle == 83) && !(cycle_.peck_mm > 0.0)) {
    const bool given = words().has('Q');
    alarm(45,
          fmt::format("drilling cycle G{} {} a depth of cut Q{}", state_.cycle, given ? "with" : "without",
                      given ? " of 0" : ""),
          given ? words()['Q'].column : 1);
  }
}

// Before a single hole is expanded: a thousandth of a millimetre for Q fills the memory.
void Interpreter::require_room_for_holes(int holes) {
  const double cuts = cuts_per_hole(cycle_);
  const double moves = holes * cuts * max_moves_per_cut(cycle_);
  const double whole = static_cast<double>(work_.moves()) + moves;
  if (const auto passed = work_.passed(whole)) {
    ended_ = true;
    fail(fmt::format("drilling cycle G{} feeds down {:.0f} times in {} hole(s), {:.3f} mm deep: with its {:.0f} moves "
                     "the program comes to {:.0f}, more than {}",
                     cycle_.code, cuts, holes, std::abs(cycle_.r_mm - cycle_.bottom_mm), moves, whole, *passed),
         words().has('Q') ? words()['Q'].column : 1);
  }
}

// Moves over the next hole of the block and drills it.
void Interpreter::drill_hole(int axis, double feed_mm_per_s) {
  const auto z = static_cast<std::size_t>(axis);
  const bool incremental = state_.distance == 91;
  Vector3 hole = state_.position_mm;
  for (int i = 0; i < axis_count; ++i) {
    const char letter = static_cast<char>('X' + i);
    if (i == axis || !words().has(letter)) {
      continue;
    }
    const double value = length_mm(words()[letter]);
    hole[i] = incremental ? hole[i] + value : value;
    if (!incremental) {
      state_.known[static_cast<std::size_t>(i)] = true;
    }
  }
  OtherMove approach{make_line(state_.position_mm, hole, 0.0, line_number_), 0.0};
  approach.segment.kind = SegmentKind::rapid;
  add_move(approach);
  if (state_.known[z] && feed_mm_per_s > 0.0) {
    std::vector<OtherMove> moves;
    state_.position_mm = expand_cycle(cycle_, hole, axis, feed_mm_per_s, line_number_, moves);
    for (const OtherMove& move : moves) {
      add_move(move);
    }
  } else {
    state_.position_mm = hole;
    if (cycle_.return_to_r) {
      state_.position_mm[axis] = cycle_.r_mm;
      state_.known[z] = !incremental && state_.known[z];
    }
  }
}

void Interpreter::cycle_block() {
  const int axis = plane_normal(state_.plane);
  read_cycle_words(axis);
  const int repeats = cycle_repeats();
  if (repeats > 0) {
    require_cycle_data();
  }
  const double rate = state_.feed_mode != 93 ? feed_mm_per_s(0.0) : 0.0;
  if (foreign_ != 0) {
    return;
  }
  if (state_.known[static_cast<std::size_t>(axis)] && rate > 0.0) {
    require_room_for_holes(repeats);
  }
  for (int k = 0; k < repeats; ++k) {
    drill_hole(axis, rate);
  }
}

}  // namespace shapegcode::detail
