// Reading blocks under coordinate modes; rewriter_codes.cpp switches them, rewriter_output.cpp writes the blocks.
#include "program/rewrite/move_rewriter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "path/arc_frame.hpp"
#include "program/interpret/arc_geometry.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

constexpr double degree = std::numbers::pi / 180.0;
constexpr std::uint32_t coordinate_groups =
    group_bit(Group::polar) | group_bit(Group::scaling) | group_bit(Group::mirror) | group_bit(Group::rotation);

// G51, G51.1, G50.1 and G68: their axis words are data of the mode.
constexpr std::array mode_data_codes = {510, 511, 501, 680};
// G28, G30, G53, G92, G52 and G10: their axis words are no programmed point.
constexpr std::array machine_coordinate_codes = {280, 300, 530, 920, 520, 100};

bool has_code(const BlockWords& words, int g_tenths) noexcept {
  for (int k = 0; k < words.g_count; ++k) {
    if (words.g_tenths[static_cast<std::size_t>(k)] == g_tenths) {
      return true;
    }
  }
  return false;
}

template <std::size_t Count>
bool has_any_code(const BlockWords& words, const std::array<int, Count>& codes) noexcept {
  return std::any_of(codes.begin(), codes.end(), [&](int code) { return has_code(words, code); });
}

}  // namespace

void MoveRewriter::fail(const std::string& message, std::uint32_t column) const {
  throw Error(ErrorKind::program, message, origin_.line, column);
}

bool MoveRewriter::wants(const BlockWords& words) const noexcept {
  if (!idle() || modes_.active() || polar_ || words.corner != nullptr) {
    return true;
  }
  // Cancelling what is not on leaves a block as it is.
  if ((words.groups & coordinate_groups) != 0) {
    return true;
  }
  return options_.expand_compensation && (compensation_ != 40 || has_code(words, 410) || has_code(words, 420));
}

double MoveRewriter::angle_rad(const Word& word) const noexcept {
  return word.value * (word.has_point || options_.calculator_decimal_point ? 1.0 : 0.001) * degree;
}

void MoveRewriter::synchronise() {
  programmed_ = interpreter_.state();
  // What was written is rounded to the increment: the exact point stays where nothing else moved the tool.
  const double slack = increment_mm(programmed_.units);
  const Vector3 point = modes_.active() ? modes_.apply(programmed_point_) : programmed_point_;
  for (int axis = 0; axis < axis_count; ++axis) {
    if (std::abs(point[axis] - programmed_.position_mm[axis]) < slack) {
      programmed_.position_mm[axis] = point[axis];
    }
  }
  programmed_point_ = modes_.active() ? modes_.undo(programmed_.position_mm) : programmed_.position_mm;
}

void MoveRewriter::block(const ParsedBlock& block, const LineOrigin& origin) {
  const BlockWords& words = block.sorted();
  block_ = &block;
  words_ = &words;
  origin_ = origin;
  interpreter_.require_plain_words(words, origin.line);
  if (idle()) {
    synchronise();
  }
  keeps_compensation_ = programmed_.compensation != 40;
  if (block.optional_skip && !block_skip(options_, block.skip_switch).has_value()) {
    fail(
        "'/' under a coordinate mode or cutter compensation: whether the block runs decides where the tool goes; say "
        "it in the machine file (input.block_skip)");
  }
  // M02, M30, tool change and machine coordinates end what waits; so does a code that moves the coordinates.
  constexpr std::uint32_t ends =
      group_bit(Group::coordinates) | group_bit(Group::unknown_position) | group_bit(Group::foreign);
  bool ends_span = (words.groups & ends) != 0 || has_any_code(words, machine_coordinate_codes);
  for (int k = 0; k < words.m_count; ++k) {
    const int m = words.m_codes[static_cast<std::size_t>(k)];
    ends_span = ends_span || m == 2 || m == 30 || m == 6;
  }
  if (ends_span && !idle()) {
    flush();
    synchronise();
  }
  refuse_machine_coordinates();
  read_codes(words);
  Item item;
  item.origin = origin;
  item.distance = programmed_.distance;
  item.units = programmed_.units;
  item.compensation = compensation_;
  item.radius_mm = radius_mm_;
  if (modes_.flips(plane_normal(programmed_.plane)) && item.compensation != 40) {
    item.compensation = item.compensation == 41 ? 42 : 41;
  }
  keep_words(item);
  // X Y Z of G04, G10, G28, G51, G68 ... are no move.
  const bool own_axes = has_any_code(words, mode_data_codes) || has_any_code(words, machine_coordinate_codes) ||
                        (words.groups & group_bit(Group::unknown_position)) != 0 || has_code(words, 40);
  const bool drills = programmed_.cycle != 80 && !own_axes;
  if (drills && words.has_any(hole_letters)) {
    drill_holes(std::move(item));
    return;
  }
  if (words.has_any(axis_letters | centre_letters) && !own_axes) {
    read_move(item);
  } else if (corner_waits_ && words.has_any(~letter_mask("N"))) {
    refuse_corner(origin.line);
  }
  if (item.move || !item.head.empty() || !item.tail.empty()) {
    enqueue(std::move(item));
  }
}

// Each hole gets a block of its own: its position may be anything but a multiple of the first step.
void MoveRewriter::drill_holes(Item item) {
  const BlockWords& words = *words_;
  const int repeats = words.has('K')   ? static_cast<int>(words['K'].value)
                      : words.has('L') ? static_cast<int>(words['L'].value)
                                       : 1;
  const bool data_only = repeats == 0;
  for (int k = 0; k < std::clamp(repeats, 1, 9999); ++k) {
    Item hole = item;
    read_cycle(hole, data_only);
    item.head.clear();
    item.tail.clear();
    const Vector3 programmed_hole = hole_;
    enqueue(std::move(hole));
    synchronise();
    // Of several holes in G91 each is a step from where the one before should be, not from its rounded position.
    const ArcFrame plane(plane_normal(programmed_.plane));
    for (const int axis : {plane.a, plane.b}) {
      programmed_point_[axis] = programmed_hole[axis];
    }
  }
}

// G27 ... G30, G53, G92, G52 and G54 ... speak of coordinates that the modes do not change.
void MoveRewriter::refuse_machine_coordinates() const {
  // The cancelling code may share its block with others ("G40 G69 G80 G54", the safety line of many programs).
  CoordinateModes left = modes_;
  left.rotation = left.rotation && !has_code(*words_, 690);
  left.scaling = left.scaling && !has_code(*words_, 500);
  if (has_code(*words_, 501) && !words_->has_any(axis_letters)) {
    left.mirror = {};
  }
  if (!left.active() && (!polar_ || has_code(*words_, 150))) {
    return;
  }
  for (int k = 0; k < words_->g_count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const int g = words_->g_tenths[i];
    const bool reference = g == 270 || g == 280 || g == 290 || g == 300 || g == 530;
    bool named = false;
    for (int axis = 0; axis < axis_count; ++axis) {
      named = named || (words_->has(static_cast<char>('X' + axis)) && modes_.acts_on(axis));
    }
    if ((reference && named) || g == 920 || g == 520 || words_->g_group[i] == Group::coordinates) {
      fail(g_code_name(g) + " while G51, G51.1, G68 or G16 is on: the control wants these cancelled first",
           words_->g_column[i]);
    }
  }
}

// Whether a word does not stand in the plain block.
bool MoveRewriter::drops(const Word& word, int g_tenths) const noexcept {
  if (word.letter == 'G') {
    switch (group_of(g_tenths)) {
      case Group::polar:
      case Group::scaling:
      case Group::mirror:
      case Group::rotation:
      case Group::motion:
        return true;
      case Group::compensation:
        return options_.expand_compensation && !keeps_compensation_;
      default:
        return false;
    }
  }
  return word.letter == 'D' && options_.expand_compensation && !keeps_compensation_;
}

void MoveRewriter::keep_words(Item& item) const {
  const BlockWords& words = *words_;
  const bool taken = has_any_code(words, mode_data_codes);
  const bool raw = !taken && (words.groups & (group_bit(Group::none) | group_bit(Group::unknown_position))) != 0 &&
                   !has_code(words, 90);
  const auto add = [&](std::string& to, std::string_view text) {
    if (!to.empty()) {
      to += ' ';
    }
    to += text;
  };
  int g = 0;
  bool moves = false;
  for (const Word& word : *block_) {
    const std::string_view text = block_->text_of(word);
    if (word.letter == 'N') {
      add(item.head, text);
    } else if (word.letter == 'G') {
      const int code = words.g_tenths[static_cast<std::size_t>(g++)];
      if (!drops(word, code)) {
        add(item.head, text);
      }
    } else if ((word.letter >= 'X' && word.letter <= 'Z') || (word.letter >= 'I' && word.letter <= 'K') ||
               word.letter == 'R' || word.letter == '<' || word.letter == '>') {
      moves = true;
      if (raw) {
        add(item.tail, text);
      }
    } else if ((taken && word.letter == 'P') || (word.letter == 'L' && programmed_.cycle != 80)) {
      continue;
    } else if (!drops(word, 0)) {
      add(item.tail, text);
    }
  }
  // A motion code without a move stays for its own sake.
  if (!moves && (words.groups & group_bit(Group::motion)) != 0) {
    add(item.head, fmt::format("G0{}", programmed_.motion));
  }
  for (std::size_t i = 0; i < block_->comment_count; ++i) {
    add(item.tail, block_->comments[i]);
  }
}

// The end point as programmed, and the axes whose words the plain block needs.
void MoveRewriter::read_target(Item& item, Vector3& end) {
  const BlockWords& words = *words_;
  const bool incremental = programmed_.distance == 91;
  const int normal = plane_normal(programmed_.plane);
  const ArcFrame plane(normal);
  const int a = plane.a;
  const int b = plane.b;
  end = programmed_point_;
  std::array<bool, axis_count> given{};
  for (int axis = 0; axis < axis_count; ++axis) {
    const char letter = static_cast<char>('X' + axis);
    if (!words.has(letter)) {
      continue;
    }
    given[static_cast<std::size_t>(axis)] = true;
    if (!(polar_ && axis != normal)) {
      const double value = interpreter_.length_mm(words[letter]);
      end[axis] = incremental ? end[axis] + value : value;
    }
  }
  const auto letter_of = [](int axis) { return static_cast<char>('X' + axis); };
  const bool turned = polar_ && (given[static_cast<std::size_t>(a)] || given[static_cast<std::size_t>(b)]);
  if (turned) {
    if (words.has(letter_of(a))) {
      // A radius in G91 counts from the present position, one in G90 from the origin; an angle alone keeps the pole.
      polar_radius_ = interpreter_.length_mm(words[letter_of(a)]);
      polar_pole_ = incremental ? programmed_point_ : Vector3(Vector3::Zero());
    }
    if (words.has(letter_of(b))) {
      const double angle = angle_rad(words[letter_of(b)]);
      polar_angle_rad_ = incremental ? polar_angle_rad_ + angle : angle;
    }
    end[a] = polar_pole_[a] + polar_radius_ * std::cos(polar_angle_rad_);
    end[b] = polar_pole_[b] + polar_radius_ * std::sin(polar_angle_rad_);
    given[static_cast<std::size_t>(a)] = given[static_cast<std::size_t>(b)] = true;
  }
  for (int axis = 0; axis < axis_count; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    item.axes[i] = given[i];
    if (!modes_.mixes(axis)) {
      continue;
    }
    const int partner = 3 - axis - modes_.rotation_normal;
    item.axes[i] = given[i] || given[static_cast<std::size_t>(partner)];
    if (item.axes[i] && !incremental && !given[i] && !programmed_.known[i]) {
      fail(std::string("position of ") + letter_of(axis) +
           " is not known, and the rotation G68 mixes it with the other axis: program both first");
    }
  }
  for (int axis = 0; axis < axis_count; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    programmed_.known[i] = programmed_.known[i] || (item.axes[i] && !incremental);
  }
}

Segment MoveRewriter::programmed_segment(const Vector3& end) const {
  const BlockWords& words = *words_;
  if (programmed_.motion != 2 && programmed_.motion != 3) {
    Segment line = make_line(programmed_point_, end, 0.0, origin_.line);
    if (programmed_.motion == 0) {
      line.kind = SegmentKind::rapid;
    }
    return line;
  }
  ArcWords arc;
  arc.start_mm = programmed_point_;
  arc.end_mm = end;
  arc.clockwise = programmed_.motion == 2;
  arc.normal = plane_normal(programmed_.plane);
  arc.tolerance_mm = options_.arc_tolerance_mm;
  if (words.has('R')) {
    arc.radius_mm = interpreter_.length_mm(words['R']);
  } else if (words.has_any(centre_letters) && !polar_) {
    arc.centre_mm = arc.start_mm;
    for (int axis = 0; axis < axis_count; ++axis) {
      const char letter = static_cast<char>('I' + axis);
      if (words.has(letter)) {
        const double value = interpreter_.length_mm(words[letter]);
        arc.centre_mm[axis] = options_.absolute_arc_centres ? value : arc.start_mm[axis] + value;
      }
    }
  } else {
    throw alarm_error(22, std::string("arc without R") + (polar_ ? " in polar coordinates G16" : " or I J K"),
                      origin_.line, 1);
  }
  return resolve_arc(arc, 0.0, origin_.line, words.has('R') ? words['R'].column : 1);
}

void MoveRewriter::read_move(Item& item) {
  Vector3 end;
  const std::array<bool, axis_count> known_before = programmed_.known;
  read_target(item, end);
  const bool arc = programmed_.motion == 2 || programmed_.motion == 3;
  if (programmed_.motion > 3) {
    fail("threading G33 under a coordinate mode, corner word or cutter compensation is not supported");
  }
  const int normal = plane_normal(programmed_.plane);
  const bool needs_start = arc || compensation_ != 40 || words_->corner != nullptr || corner_waits_;
  for (int axis = 0; axis < axis_count && needs_start; ++axis) {
    if (axis != normal && !known_before[static_cast<std::size_t>(axis)] && programmed_.distance == 90) {
      fail(std::string("the position of ") + static_cast<char>('X' + axis) + " before this move is not known");
    }
  }
  item.move = true;
  item.segment = modes_.apply(programmed_segment(end), origin_.line);
  // The programmed point, not what the modes' arithmetic made of it.
  programmed_point_ = end;
  programmed_.position_mm = item.segment.end_mm;
  if (arc) {
    const ArcFrame plane(normal);
    item.axes[static_cast<std::size_t>(plane.a)] = item.axes[static_cast<std::size_t>(plane.b)] = true;
  }
}

void MoveRewriter::read_cycle(Item& item, bool data_only) {
  const Vector3 present = programmed_point_;
  const double radius = polar_radius_;
  const double angle = polar_angle_rad_;
  Vector3 end;
  read_target(item, end);
  const BlockWords& words = *words_;
  const int normal = plane_normal(programmed_.plane);
  const bool incremental = programmed_.distance == 91;
  if (compensation_ != 40 || span_open_) {
    fail(fmt::format("drilling cycle G{} under cutter compensation: cancel it with G40 first", programmed_.cycle));
  }
  if (modes_.mixes(normal)) {
    fail("drilling along an axis that the rotation G68 turns is not supported");
  }
  const auto level = [&](char letter) {
    const double value = interpreter_.length_mm(words[letter]);
    if (incremental) {
      return value * modes_.factor(normal);
    }
    Vector3 point = programmed_point_;
    point[normal] = value;
    return modes_.scaled_and_mirrored(point)[normal];
  };
  const char depth = static_cast<char>('X' + normal);
  for (const char letter : {depth, 'R'}) {
    if (words.has(letter)) {
      item.levels += ' ';
      append_length(item.levels, letter, level(letter), programmed_.units);
    }
  }
  item.axes[static_cast<std::size_t>(normal)] = false;
  end[normal] = programmed_point_[normal];
  if (data_only) {  // K0 stores the levels and drills nothing
    item.levels += " K0";
    item.axes = {false, false, false};
    end = present;
    polar_radius_ = radius;
    polar_angle_rad_ = angle;
  }
  const Vector3 target = modes_.apply(end);
  hole_ = end;
  item.move = item.cycle = true;
  item.increment_mm = target - programmed_.position_mm;
  item.segment = make_line(programmed_.position_mm, target, 0.0, origin_.line);
}

}  // namespace shapegcode::detail
