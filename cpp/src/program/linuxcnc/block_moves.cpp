#include <fmt/format.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <utility>

#include "program/linuxcnc/block_runner.hpp"
#include "program/linuxcnc/drilling.hpp"
#include "program/linuxcnc/program_text.hpp"
#include "program/text/characters.hpp"

namespace shapegcode::linuxcnc {
namespace {

using dialect::Complex;
using dialect::number_text;

constexpr double full_turn_rad = 2.0 * std::numbers::pi;
constexpr std::uint32_t all_axes = letter_set("xyzabc");
constexpr std::uint32_t polar = letter_set("@^");

double degrees(double angle_rad) { return angle_rad * (180.0 / std::numbers::pi); }

/// A zero of the quotient has no sign, so that its angle is that of the positive one.
Complex divided_by(Complex value, double unit) {
  return {(value.real() + value.imag() * 0.0) / unit, (value.imag() - value.real() * 0.0) / unit};
}

double radians_of(double angle_deg) { return angle_deg * (std::numbers::pi / 180.0); }

}  // namespace

void BlockRunner::run_axes(const GroupCodes& codes, WordValues values, std::string pending) {
  if (const auto one_shot = codes.get(Group::one_shot)) {
    flush(pending);
    sync();
    offsets_.one_shot(*one_shot, values);
    if (!codes.has(Group::motion)) return;
    values.remove(all_axes);
  }
  run_motion(codes, values, pending);
}

void BlockRunner::run_motion(const GroupCodes& codes, const WordValues& values, std::string& pending) {
  Modes& modes = state_.modes;
  const int before = modes.motion;
  const bool is_given = codes.has(Group::motion);
  modes.motion = codes.get(Group::motion).value_or(before);
  const bool has_axes = values.has_any(all_axes | polar) && codes.get(Group::length) != 431;
  const bool has_centre = values.has_any(letter_set(centre_letters));
  if (!is_cycle(modes.motion)) state_.cycle.reset();
  if (modes.motion == 800) {
    if (has_axes && (is_given || !codes.has(Group::dwell))) {
      refuse("axis words while no G code of motion is in force (G80)");
    }
    if (is_given) pending += "G80";
    flush(pending);
  } else if (is_cycle(modes.motion)) {
    flush(pending);
    if (has_axes || is_given) run_cycle(values, before != modes.motion);
  } else if (has_axes || (modes.motion >= 20 && has_centre)) {
    run_move(values, pending, codes.has(Group::machine));
  } else {
    if (modes.motion < 20 && before != modes.motion) {
      written_motion_ = modes.motion;
      pending += fmt::format("G{:02}", modes.motion / 10);
    }
    flush(pending);
  }
}

void BlockRunner::run_cycle(WordValues values, bool is_first) {
  const Modes& modes = state_.modes;
  if (modes.feed_mode == 930) refuse("a drilling cycle in G93");
  std::string feed = modes.feed > 0.0 ? written_f() : std::string();
  written_motion_.reset();
  std::int64_t times = 1;
  if (values.has_any(polar)) {  // each repetition goes on from the hole before it
    times = truncated(values.get('l', 1.0));
    if (times > max_cycle_repeats) {
      refuse(fmt::format("L{:g}: a cycle is repeated 1 to {} times", values['l'], max_cycle_repeats));
    }
    values.remove(letter_set("l"));
  }
  if (const std::string code = distance_word(900); !code.empty()) put(code);
  bool is_first_line = true;
  const WriteLine write = [&](const std::string& line) {
    put(is_first_line || line.starts_with("G01") ? line + feed : line);
    is_first_line = false;
  };
  for (std::int64_t k = 0; k < times; ++k) {
    drill(state_, modes.motion, cartesian(values), is_first && k == 0, write);
  }
}

void BlockRunner::run_move(const WordValues& words, std::string& codes, bool is_machine) {
  Modes& modes = state_.modes;
  WordValues values = cartesian(words);
  if (is_machine) {
    flush(codes);
    sync();
    written_motion_.reset();
    if (modes.motion > 10) refuse("G53 is read with G0 or G1 only");
    const std::optional<WordValues> in_program = offsets_.in_program(values, modes.motion == 0);
    if (!in_program) return;
    values = *in_program;
  }
  const bool is_incremental = modes.distance == 910 && !is_machine;
  const Triple start = state_.position;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!values.has(axis_letters[axis])) continue;
    const double given = values[axis_letters[axis]] * state_.unit_mm();
    std::optional<double>& here = state_.position[axis];
    if (!is_incremental) {
      here = given;
    } else if (here) {
      here = *here + given;
    }
  }
  const std::string distance = distance_word(is_incremental ? 910 : 900);
  const std::string head = fmt::format("{}{}G{:02}", codes, distance, modes.motion / 10);
  written_motion_ = modes.motion;
  if (modes.motion < 20) {
    const std::string line = head + words_of(values, "xyzabc");
    put(line + feed_word(values));
  } else {
    run_arc(head, values, start, is_incremental);
  }
}

std::string BlockRunner::feed_word(const WordValues& values) {
  const Modes& modes = state_.modes;
  if (modes.motion == 0) return values.has('f') && modes.feed_mode == 940 ? written_f() : std::string();
  if (modes.feed_mode == 930 && !values.has('f')) refuse("a move in G93 without F");
  if (modes.feed <= 0.0) refuse("a cutting move, and no F greater than 0 was given before it");
  return written_f();
}

WordValues BlockRunner::cartesian(const WordValues& values) const {
  if (!values.has_any(polar)) return values;
  if (state_.modes.plane != 170 || values.has_any(letter_set("xy"))) {
    refuse("polar words @ and ^ are read in G17 only, without X and Y");
  }
  if (!state_.position[0] || !state_.position[1]) {
    refuse("the position of X and Y is not known, from which @ and ^ go on");
  }
  const Complex here = divided_by({*state_.position[0], *state_.position[1]}, state_.unit_mm());
  const bool is_incremental = state_.modes.distance == 910;
  double radius = std::abs(here);
  double angle_deg = degrees(std::arg(here));
  if (radius == 0.0 && !values.has('^')) refuse("a polar radius @ without an angle ^ at the origin");
  if (is_incremental) {
    radius += values.get('@', 0.0);
    angle_deg += values.get('^', 0.0);
  } else {
    radius = values.get('@', radius);
    angle_deg = values.get('^', angle_deg);
  }
  const double angle = radians_of(angle_deg);
  const Complex to = Complex(radius * std::cos(angle), radius * std::sin(angle)) - (is_incremental ? here : Complex());
  WordValues result = values;
  result.remove(polar);
  result.set('x', to.real());
  result.set('y', to.imag());
  return result;
}

void BlockRunner::run_arc(const std::string& head, const WordValues& values, const Triple& start, bool is_incremental) {
  const Modes& modes = state_.modes;
  Arc arc{.axes = dialect::axes_of(modes.plane / 10),
          .start = start,
          .is_incremental = is_incremental,
          .turns = values.get('p', 1.0),
          .from = {},
          .to = {},
          .centre = {},
          .turn = modes.motion == 30 ? 1 : -1};
  const std::string names = {centre_letters[arc.axes.first], centre_letters[arc.axes.second]};
  if (arc.turns != std::trunc(arc.turns) || arc.turns < 1.0) {
    refuse(fmt::format("P{:g}: an arc has a whole number of turns, 1 or more", arc.turns));
  }
  if (values.has('r') && values.has_any(letter_set(centre_letters))) refuse("an arc with R and I, J or K");
  if (!values.has('r') && !values.has_any(letter_set(names))) {
    refuse(fmt::format("an arc without R, {} or {}", upper(names[0]), upper(names[1])));
  }
  const Triple& end = state_.position;
  if (!start[arc.axes.first] || !start[arc.axes.second] || !end[arc.axes.first] || !end[arc.axes.second]) {
    if (arc.turns > 1.0 || modes.centres == 901 || modes.feed_mode == 930) {
      refuse("the position is not known, which this arc needs (P turns, G90.1, G93)");
    }
    const std::string line = head + words_of(values, "xyzabcijkr");
    put(line + feed_word(values));
    return;
  }
  arc.from = {*start[arc.axes.first], *start[arc.axes.second]};
  arc.to = {*end[arc.axes.first], *end[arc.axes.second]};
  find_centre(arc, values);
  put_arc(arc, head, values);
}

void BlockRunner::find_centre(Arc& arc, const WordValues& values) const {
  constexpr double most_too_small_mm = 0.00127;
  const double unit = state_.unit_mm();
  const char first = centre_letters[arc.axes.first];
  const char second = centre_letters[arc.axes.second];
  if (values.has('r')) {
    const double radius = values['r'] * unit;
    const double chord = std::abs(arc.to - arc.from);
    if (chord == 0.0 || radius == 0.0) refuse("an arc with R ends where it begins, or its R is 0");
    if (chord / 2.0 - std::abs(radius) > most_too_small_mm) {
      refuse(fmt::format("R{:g} mm is too small for a chord of {:g} mm", std::abs(radius), chord));
    }
    arc.centre = dialect::centre_by_radius(arc.from, arc.to, radius, arc.turn);
  } else {
    const bool is_absolute = state_.modes.centres == 901;
    if (is_absolute && !(values.has(first) && values.has(second))) {
      refuse(fmt::format("G90.1 needs {} and {}", upper(first), upper(second)));
    }
    const Complex given = Complex(values.get(first, 0.0), values.get(second, 0.0)) * unit;
    arc.centre = is_absolute ? given : arc.from + given;
  }
  arc.total_rad =
      std::abs(dialect::sweep_of(arc.from, arc.to, arc.centre, arc.turn)) + (arc.turns - 1.0) * full_turn_rad;
}

void BlockRunner::put_arc(const Arc& arc, const std::string& head, const WordValues& values) {
  const double unit = state_.unit_mm();
  const Complex spoke = divided_by(arc.centre - arc.from, unit);
  WordValues centre;
  centre.set(centre_letters[arc.axes.first], spoke.real());
  centre.set(centre_letters[arc.axes.second], spoke.imag());
  const std::string centre_words =
      words_of(centre, std::string{centre_letters[arc.axes.first], centre_letters[arc.axes.second]});
  const char normal = axis_letters[arc.axes.normal];
  const std::optional<double> rise = values.find(normal);
  const std::string feed = arc_feed(arc, values);
  WordValues last = values;
  auto put_block = [&, is_first = true](const std::string& words) mutable {
    put(is_first ? head + words + feed : words);
    is_first = false;
  };
  for (double turn = 1.0; turn < arc.turns; turn += 1.0) {
    std::string axial;
    if (rise) {
      if (!arc.start[arc.axes.normal] && !arc.is_incremental) {
        refuse(fmt::format("the position of {} is not known, from which the helix rises", upper(normal)));
      }
      const double share = full_turn_rad / arc.total_rad;
      const double begin = arc.start[arc.axes.normal].value_or(0.0) / unit;
      const double step = arc.is_incremental ? *rise * share : (*rise - begin) * share;
      axial = upper(normal) + number_text(arc.is_incremental ? step : begin + turn * step);
      if (arc.is_incremental) last.set(normal, *rise * (1.0 - turn * share));
    }
    put_block(axial + centre_words);
  }
  put_block(words_of(last, "xyzabc") + centre_words);
}

std::string BlockRunner::arc_feed(const Arc& arc, const WordValues& values) {
  std::string feed = feed_word(values);
  if (state_.modes.feed_mode != 930) return feed;
  const std::optional<double> begin = arc.start[arc.axes.normal];
  const std::optional<double> end = state_.position[arc.axes.normal];
  const double radius = std::abs(arc.from - arc.centre);
  const double rise = begin && end ? *end - *begin : 0.0;
  if (radius == 0.0) refuse("an arc in G93 whose centre is its start");
  const double length = std::hypot(radius * arc.total_rad, rise);
  note("in G93 F counts the whole arc on LinuxCNC; FANUC's counts its radius: worked out", "G93");
  return "F" + number_text(state_.modes.feed * length / radius);
}

}  // namespace shapegcode::linuxcnc
