// Output of simple blocks: corners, compensation, words rounded to the increment.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "path/arc_frame.hpp"
#include "program/rewrite/corner_words.hpp"
#include "program/rewrite/cutter_compensation.hpp"
#include "program/rewrite/move_rewriter.hpp"
#include "program/text/number_format.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode::detail {
namespace {

// A chord below so many increments is written as a line: rounding could turn the arc into a full circle.
constexpr double min_chord_increments = 4.0;

bool in_plane(const Segment& segment, int normal) noexcept {
  return segment.kind == SegmentKind::arc || ArcFrame(normal).radius(segment.end_mm, segment.start_mm) > 1e-9;
}

}  // namespace

double MoveRewriter::increment_mm(int units) const noexcept { return min_increment(options_, units) * unit_mm(units); }

void MoveRewriter::append_length(std::string& text, char letter, double value_mm, int units) const {
  text += letter;
  append_decimal(text, std::llround(value_mm / increment_mm(units)), length_decimals(options_, units));
}

void MoveRewriter::append_axis(std::string& text, const Item& item, int axis, double target_mm, bool always) const {
  const double increment = increment_mm(item.units);
  const ModalState& written = interpreter_.state();
  const std::int64_t target = std::llround(target_mm / increment);
  const std::int64_t present = std::llround(written.position_mm[axis] / increment);
  if (!always && target == present) {
    return;
  }
  text += ' ';
  const auto steps = item.distance == 91 ? target - present : target;
  append_length(text, static_cast<char>('X' + axis), static_cast<double>(steps) * increment, item.units);
}

// I J K from the rounded start point, chosen among the neighbours so that start and end radius agree best: rounding
// must not make a control refuse the arc.
void MoveRewriter::append_centre(std::string& text, const Item& item, const Segment& arc) const {
  const ArcFrame frame(arc.normal);
  const int a = frame.a;
  const int b = frame.b;
  const double increment = increment_mm(item.units);
  const Vector3& start = interpreter_.state().position_mm;
  const auto grid = [&](double value) { return std::round(value / increment) * increment; };
  const double end_a = grid(arc.end_mm[a]);
  const double end_b = grid(arc.end_mm[b]);
  double best_a = 0.0;
  double best_b = 0.0;
  double best = 1e300;
  for (int i = -1; i <= 1; ++i) {
    for (int j = -1; j <= 1; ++j) {
      const double centre_a = grid(arc.centre_mm[a] - start[a]) + i * increment;
      const double centre_b = grid(arc.centre_mm[b] - start[b]) + j * increment;
      const double radius = std::hypot(centre_a, centre_b);
      const double mismatch = std::abs(radius - std::hypot(end_a - start[a] - centre_a, end_b - start[b] - centre_b));
      const double shift = std::hypot(start[a] + centre_a - arc.centre_mm[a], start[b] + centre_b - arc.centre_mm[b]);
      // A full circle has no mismatch anywhere: there the nearest centre wins.
      const double cost = mismatch + 0.3 * shift;
      if (cost < best) {
        best = cost;
        best_a = centre_a;
        best_b = centre_b;
      }
    }
  }
  // In the order I J K.
  std::array<double, axis_count> centre{};
  centre[static_cast<std::size_t>(a)] = best_a;
  centre[static_cast<std::size_t>(b)] = best_b;
  for (int axis = 0; axis < axis_count; ++axis) {
    if (axis != arc.normal) {
      const auto i = static_cast<std::size_t>(axis);
      text += ' ';
      const double position = options_.absolute_arc_centres ? start[axis] + centre[i] : centre[i];
      append_length(text, static_cast<char>('I' + axis), position, item.units);
    }
  }
}

void MoveRewriter::write(const Item& item, const Segment* segment, bool with_words) {
  std::string text = with_words ? item.head : std::string();
  if (segment != nullptr && item.cycle) {
    for (int axis = 0; axis < axis_count; ++axis) {
      if (!item.axes[static_cast<std::size_t>(axis)]) {
        continue;
      }
      text += ' ';
      append_length(text, static_cast<char>('X' + axis),
                    item.distance == 91 ? item.increment_mm[axis] : segment->end_mm[axis], item.units);
    }
    text += item.levels;
  } else if (segment != nullptr) {
    std::string axes;
    const double chord = (segment->end_mm - segment->start_mm).norm();
    const bool full = std::abs(segment->sweep_rad) > 1.0;
    const bool arc =
        segment->kind == SegmentKind::arc && (full || chord >= min_chord_increments * increment_mm(item.units));
    for (int axis = 0; axis < axis_count; ++axis) {
      const bool asked = with_words && item.axes[static_cast<std::size_t>(axis)] && !span_open_;
      append_axis(axes, item, axis, segment->end_mm[axis], asked || (arc && axis != segment->normal));
    }
    if (arc) {
      append_centre(axes, item, *segment);
    }
    if (!axes.empty()) {
      const char* code = segment->kind == SegmentKind::rapid ? "G00" : "G01";
      if (arc) {
        // Positive sweeps turn the plane's first axis towards its second: G03.
        code = segment->sweep_rad > 0.0 ? "G03" : "G02";
      }
      text += text.empty() ? "" : " ";
      text += code;
      text += axes;
    }
  }
  if (with_words && !item.tail.empty()) {
    text += text.empty() ? "" : " ";
    text += item.tail;
  }
  if (!text.empty()) {
    const std::size_t first = text.find_first_not_of(' ');
    put_(std::string_view(text).substr(first), item.origin);
  }
}

// Rounds or chamfers the corner between the move that waits and this one.
void MoveRewriter::meet_corner(Item& item) {
  const int normal = plane_normal(programmed_.plane);
  if (item.segment.kind == SegmentKind::rapid || item.cycle) {
    throw alarm_error(52, "a block with ,R or ,C must be followed by G01, G02 or G03", item.origin.line, 1);
  }
  const auto previous =
      std::find_if(waiting_.rbegin(), waiting_.rend(), [](const Item& waiting) { return waiting.move; });
  CornerResult corner = insert_corner(previous->segment, item.segment, corner_, normal);
  previous->segment = corner.before;
  item.segment = corner.after;
  if (corner.inserted) {
    Item inserted;
    inserted.origin = corner_origin_;
    inserted.segment = *corner.inserted;
    inserted.move = true;
    inserted.distance = item.distance;
    inserted.units = item.units;
    inserted.compensation = previous->compensation;
    inserted.radius_mm = previous->radius_mm;
    waiting_.push_back(std::move(inserted));
  }
}

// No move of the plane behind a corner word; `line` has something else, 0: nothing comes.
void MoveRewriter::refuse_corner(std::uint32_t line) {
  corner_waits_ = false;
  throw alarm_error(51,
                    "a block with ,R or ,C must be followed by a move in the plane" +
                        (line > 0 ? fmt::format(", and line {} has none", line) : std::string()),
                    corner_.line, corner_.column);
}

void MoveRewriter::enqueue(Item item) {
  const int normal = plane_normal(programmed_.plane);
  const bool moves_in_plane = item.move && !item.cycle && in_plane(item.segment, normal);
  if (corner_waits_ && item.move) {
    if (!moves_in_plane) {
      refuse_corner(item.origin.line);
    }
    meet_corner(item);
    corner_waits_ = false;
  }
  const bool ends_span = span_open_ && item.compensation == 40 && moves_in_plane;
  span_open_ = span_open_ || (item.compensation != 40 && item.move && !item.cycle);
  if (words_->corner != nullptr) {
    if (!moves_in_plane || item.segment.kind == SegmentKind::rapid) {
      throw alarm_error(50, "a corner word ,R or ,C belongs to G01, G02 or G03 with a move in the plane",
                        item.origin.line, words_->corner->column);
    }
    corner_waits_ = true;
    corner_ = {words_->corner->letter == '>', interpreter_.length_mm(*words_->corner), item.origin.line,
               words_->corner->column};
    corner_origin_ = item.origin;
  }
  waiting_.push_back(std::move(item));
  if (!corner_waits_ && (ends_span || !span_open_)) {
    flush();
  }
}

void MoveRewriter::comment(std::string_view text, const LineOrigin& origin) {
  if (idle()) {
    put_(text, origin);
    return;
  }
  Item item;
  item.origin = origin;
  item.tail = text;
  waiting_.push_back(std::move(item));
}

void MoveRewriter::flush() {
  if (waiting_.empty()) {
    return;
  }
  if (corner_waits_) {
    corner_waits_ = false;
    span_open_ = false;
    waiting_.clear();
    refuse_corner(0);
  }
  std::vector<Item> items;
  items.swap(waiting_);
  const bool compensated = span_open_;
  std::vector<std::vector<Segment>> moves(items.size());
  if (compensated) {
    std::vector<CompensationBlock> blocks;
    std::vector<std::size_t> of_item;
    for (std::size_t i = 0; i < items.size(); ++i) {
      if (items[i].move) {
        blocks.push_back({items[i].segment, items[i].compensation, items[i].radius_mm});
        of_item.push_back(i);
        program_.compensated_moves += items[i].segment.kind != SegmentKind::rapid ? 1U : 0U;
      }
    }
    CompensationOptions options;
    options.start_up = options_.compensation_start_up;
    try {
      for (CompensatedMove& move : compensate(blocks, plane_normal(programmed_.plane), options)) {
        moves[of_item[move.source]].push_back(move.segment);
      }
    } catch (Error& error) {
      span_open_ = false;
      for (const Item& item : items) {
        if (item.move && item.origin.line == error.line()) {
          error.set_file(program_.files[item.origin.file]);
        }
      }
      throw;
    }
  }
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (!compensated) {
      write(items[i], items[i].move ? &items[i].segment : nullptr, true);
    } else if (moves[i].empty()) {
      write(items[i], nullptr, true);
    }
    for (std::size_t k = 0; k < moves[i].size(); ++k) {
      write(items[i], &moves[i][k], k == 0);
    }
  }
  span_open_ = false;
}

}  // namespace shapegcode::detail
