// Codes that switch coordinate modes and cutter compensation.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "program/rewrite/move_rewriter.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {

void MoveRewriter::read_codes(const BlockWords& words) {
  for (int k = 0; k < words.g_count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const int g = words.g_tenths[i];
    const int whole = g / 10;
    switch (words.g_group[i]) {
      case Group::motion:
        programmed_.motion = whole;
        programmed_.cycle = 80;
        break;
      case Group::plane:
        set_plane(whole, words.g_column[i]);
        break;
      case Group::distance:
        programmed_.distance = whole;
        break;
      case Group::feed_mode:
        programmed_.feed_mode = whole;
        break;
      case Group::units:
        programmed_.units = whole;
        break;
      case Group::cycle:
        programmed_.cycle = whole;
        break;
      case Group::cycle_return:
        programmed_.cycle_return = whole;
        break;
      case Group::compensation:
        set_compensation(whole);
        break;
      case Group::polar:
        polar_ = g == 160;
        polar_radius_ = 0.0;
        polar_pole_.setZero();
        polar_angle_rad_ = 0.0;
        break;
      case Group::rotation:
        set_rotation(g);
        break;
      case Group::scaling:
        set_scaling(g);
        break;
      case Group::mirror:
        set_mirror(g);
        break;
      default:
        break;
    }
  }
  if (words.has('D') && options_.expand_compensation) {
    d_number_ = static_cast<int>(words['D'].value);
    if (compensation_ != 40) {
      set_compensation(compensation_);
    }
  }
}

void MoveRewriter::set_plane(int plane, std::uint32_t column) {
  const bool changes = plane != programmed_.plane;
  if (changes && compensation_ != 40 && options_.expand_compensation) {
    throw alarm_error(37, fmt::format("the plane changes to G{} under cutter compensation", plane), origin_.line,
                      column);
  }
  if (changes && (modes_.rotation || polar_)) {
    throw alarm_error(144, fmt::format("the plane changes to G{} under rotation G68 or G16", plane), origin_.line,
                      column);
  }
  programmed_.plane = plane;
}

void MoveRewriter::set_compensation(int code) {
  if (!options_.expand_compensation) {
    return;
  }
  if (code == 40) {
    compensation_ = programmed_.compensation = code;
    return;
  }
  const BlockWords& words = *words_;
  // Offset number 0 is a radius of 0, and so is none at all.
  const int number = words.has('D') ? static_cast<int>(words['D'].value) : std::max(d_number_, 0);
  const bool named = words.has('D') || d_number_ >= 0;
  d_number_ = number;
  const auto radius = number == 0 ? std::optional(0.0) : interpreter_.offsets().radius(number);
  // While the control compensates with a radius that is not known, it cannot be told to stand where the tool would.
  if (!radius || programmed_.compensation != 40) {
    // The moves stay as they are, and their path is not known.
    if (programmed_.compensation == 40) {
      interpreter_.warn_at(origin_, fmt::format("the radius of offset D{} is not known (input.tool_radius_mm, or G10 "
                                                "L12 in the program): G{} is kept as it stands",
                                                number, code));
    }
    keeps_compensation_ = true;
    programmed_.compensation = code;
    compensation_ = 40;
    return;
  }
  if (*radius == 0.0) {
    interpreter_.warn_at(origin_, fmt::format("offset D{} has a radius of 0{}: G{} shifts the path by nothing", number,
                                              named ? "" : ", as there is no D", code));
  }
  compensation_ = code;
  radius_mm_ = *radius;
  program_.expanded_radii_mm[number] = *radius;
}

void MoveRewriter::set_rotation(int g_tenths) {
  if (g_tenths == 690) {
    modes_.rotation = false;
    programmed_point_ = modes_.undo(programmed_.position_mm);
    return;
  }
  const BlockWords& words = *words_;
  if (words.has_any(centre_letters)) {
    fail("three-dimensional rotation G68 with I J K is not supported");
  }
  if (!words.has('R')) {
    fail("G68 needs an angle R");
  }
  const int normal = plane_normal(programmed_.plane);
  const double angle = angle_rad(words['R']);
  if (std::abs(angle) > 2.0 * std::numbers::pi * (1.0 + 1e-12)) {
    interpreter_.warn_at(origin_,
                         fmt::format("G68 R{:g}: a control takes -360 to 360 degrees; it turns by {:g} here",
                                     angle * 180.0 / std::numbers::pi,
                                     std::remainder(angle, 2.0 * std::numbers::pi) * 180.0 / std::numbers::pi));
  }
  const double before = modes_.rotation ? modes_.rotation_rad : 0.0;
  modes_.rotation = false;
  Vector3 centre = modes_.undo(programmed_.position_mm);
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    if (words.has(letter)) {
      centre[axis] = interpreter_.length_mm(words[letter]);
    } else if (axis != normal && !programmed_.known[static_cast<std::size_t>(axis)]) {
      fail(std::string("G68 without ") + letter + " turns about the present position, which is not known");
    }
  }
  modes_.rotation_centre = modes_.scaled_and_mirrored(centre);
  modes_.rotation = true;
  modes_.rotation_normal = normal;
  modes_.rotation_rad = programmed_.distance == 91 ? before + angle : angle;
  programmed_point_ = modes_.undo(programmed_.position_mm);
}

void MoveRewriter::set_scaling(int g_tenths) {
  if (g_tenths == 500) {
    modes_.scaling = false;
    modes_.scale = Vector3::Ones();
    programmed_point_ = modes_.undo(programmed_.position_mm);
    return;
  }
  if (compensation_ != 40) {
    throw alarm_error(141, "scaling G51 under cutter compensation", origin_.line, 1);
  }
  const BlockWords& words = *words_;
  const auto factor = [&](char letter) {
    const Word& word = words[letter];
    const double value = word.has_point ? word.value : word.value * options_.scale_unit;
    if (!(std::abs(value) > 0.0) || std::abs(value) > 1000.0) {
      throw alarm_error(142, fmt::format("scaling factor {} = {}, which must not be 0 nor above 1000", letter, value),
                        origin_.line, word.column);
    }
    return value;
  };
  const Vector3 present = programmed_point_;
  Vector3 scale = Vector3::Ones();
  if (words.has('P')) {
    scale.setConstant(factor('P'));
  } else if (words.has_any(centre_letters)) {
    for (int axis = 0; axis < axis_count; ++axis) {
      const char letter = static_cast<char>('I' + axis);
      if (words.has(letter)) {
        scale[axis] = factor(letter);
      }
    }
  } else {
    fail("G51 needs a factor: P, or I J K");
  }
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    modes_.scale_centre[axis] = words.has(letter) ? interpreter_.length_mm(words[letter]) : present[axis];
    if (!words.has(letter) && scale[axis] != 1.0 && !programmed_.known[static_cast<std::size_t>(axis)]) {
      fail(std::string("G51 without ") + letter + " scales about the present position, which is not known");
    }
  }
  modes_.scaling = true;
  modes_.scale = scale;
  programmed_point_ = modes_.undo(programmed_.position_mm);
}

void MoveRewriter::set_mirror(int g_tenths) {
  const BlockWords& words = *words_;
  const bool on = g_tenths == 511;
  if (on && !words.has_any(axis_letters)) {
    fail("G51.1 needs the axes that are mirrored: X, Y or Z");
  }
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    const auto i = static_cast<std::size_t>(axis);
    if (words.has(letter)) {
      modes_.mirror[i] = on;
      modes_.mirror_at[axis] = interpreter_.length_mm(words[letter]);
    } else if (!on && !words.has_any(axis_letters)) {
      modes_.mirror[i] = false;
    }
  }
  programmed_point_ = modes_.undo(programmed_.position_mm);
}

}  // namespace shapegcode::detail
