#include "compare/cut_difference.hpp"

#include <algorithm>
#include <cmath>

#include "compare/frechet.hpp"
#include "shapegcode/measure/contour.hpp"

namespace shapegcode::detail {
namespace {

constexpr double same_position_mm = 1e-9;
constexpr double looked_at_mm = 0.2;
constexpr double looked_at_rad = 0.035;
constexpr double same_feed = 1e-6;
constexpr double same_section_mm = 0.05;  // shaping and rounding move the position of a change of feed

// The moves of a cut one after another.
class Moves {
 public:
  explicit Moves(const Cut& cut) : cut_(cut) {}
  bool next(Segment& move) {
    for (; piece_ < cut_.pieces.size(); ++piece_, index_ = 0) {
      if (index_ < cut_.pieces[piece_].size()) {
        move = cut_.pieces[piece_][index_++];
        return true;
      }
    }
    return false;
  }

 private:
  const Cut& cut_;
  std::size_t piece_ = 0;
  std::size_t index_ = 0;
};

bool same_move(const Segment& one, const Segment& other) {
  const auto near = [](const Vector3& a, const Vector3& b) {
    return (a - b).cwiseAbs().maxCoeff() <= same_position_mm;
  };
  if (one.kind != other.kind || !near(one.start_mm, other.start_mm) || !near(one.end_mm, other.end_mm)) {
    return false;
  }
  return one.kind != SegmentKind::arc ||
         (one.normal == other.normal && std::abs(one.sweep_rad - other.sweep_rad) <= same_position_mm &&
          std::abs(one.start_radius_mm - other.start_radius_mm) <= same_position_mm);
}

bool same_section(double one_mm, double other_mm) {
  return std::abs(one_mm - other_mm) <= same_section_mm + 1e-3 * one_mm;
}

Path whole_path(const Cut& cut) {
  PathBuilder builder;
  Segment move;
  for (Moves moves(cut); moves.next(move);) {
    builder.add(move);
  }
  return builder.path();
}

// Arcs as chords that are as good as the arc.
std::vector<Vector3> polyline(const Cut& cut, double chord_mm) {
  std::vector<Vector3> points;
  points.reserve(cut.moves + 1);
  points.push_back(cut.start_mm);
  Segment move;
  for (Moves moves(cut); moves.next(move);) {
    if (move.kind == SegmentKind::arc) {
      const double radius_mm = std::max(move.start_radius_mm, chord_mm);
      const auto parts = static_cast<int>(std::ceil(std::abs(move.sweep_rad) / std::sqrt(8.0 * chord_mm / radius_mm)));
      for (int k = 1; k < parts; ++k) points.push_back(point_at(move, move.length_mm * k / parts));
    }
    points.push_back(move.end_mm);
  }
  return points;
}

// A section of one feed.
struct Section {
  double feed_mm_per_s = 0.0;
  double length_mm = 0.0;
  std::uint32_t line = 0;
};

class Sections {
 public:
  explicit Sections(const Cut& cut) : moves_(cut) { more_ = moves_.next(move_); }
  bool next(Section& section) {
    if (!more_) {
      return false;
    }
    section = {move_.feed_mm_per_s, 0.0, move_.line};
    while (more_ && std::abs(move_.feed_mm_per_s - section.feed_mm_per_s) <= same_feed * section.feed_mm_per_s) {
      section.length_mm += move_.length_mm;
      more_ = moves_.next(move_);
    }
    return true;
  }

 private:
  Moves moves_;
  Segment move_;
  bool more_;
};

}  // namespace

bool same_moves(const Cut& one, const Cut& other) {
  if (one.moves != other.moves) {
    return false;
  }
  Moves ones(one);
  Moves others(other);
  Segment a;
  Segment b;
  while (ones.next(a) && others.next(b)) {
    if (!same_move(a, b)) {
      return false;
    }
  }
  return true;
}

PathDistance path_distance(const Cut& moving, const Cut& still) {
  const Path path = whole_path(still);
  ContourTracker tracker(path);
  PathDistance found;
  const double share = moving.length_mm > 0.0 ? path.length_mm() / moving.length_mm : 0.0;
  const double slack_mm = std::min(1.0, 0.3 * path.length_mm()) + 0.1 * path.length_mm();
  std::size_t cursor = 0;
  const auto look = [&](const Vector3& point, double from_start_mm, std::uint32_t line) {
    double distance = std::abs(tracker.step(point));
    // Near another part of the path, as of a contour the other way round: that part is not meant.
    const double meant_mm = std::min(from_start_mm * share, path.length_mm());
    if (std::abs(tracker.s_mm() - meant_mm) > slack_mm) {
      distance = std::max(distance, (point - path.point(meant_mm, cursor)).norm());
    }
    if (distance > found.distance_mm) {
      found = {distance, line};
    }
  };
  Segment move;
  double from_start_mm = 0.0;
  for (Moves moves(moving); moves.next(move);) {
    if (from_start_mm == 0.0) {
      look(move.start_mm, 0.0, move.line);
    }
    const double turn = move.kind == SegmentKind::arc ? std::abs(move.sweep_rad) / looked_at_rad : 2.0;
    const auto parts = static_cast<int>(std::ceil(std::max({2.0, turn, move.length_mm / looked_at_mm})));
    for (int k = 1; k < parts; ++k) {
      const double along_mm = move.length_mm * k / parts;
      look(point_at(move, along_mm), from_start_mm + along_mm, move.line);
    }
    from_start_mm += move.length_mm;
    look(move.end_mm, from_start_mm, move.line);
  }
  return found;
}

std::optional<double> joint_distance_mm(const Cut& one, const Cut& other, double allowed_mm) {
  constexpr double accuracy = 0.02;
  if (!(allowed_mm > 0.0)) {
    return std::nullopt;
  }
  const double chord_mm = 0.1 * accuracy * allowed_mm;
  const std::vector<Vector3> ours = polyline(one, chord_mm);
  const std::vector<Vector3> theirs = polyline(other, chord_mm);
  if (!FrechetDecision(ours, theirs, allowed_mm).within()) {
    return std::nullopt;
  }
  double low_mm = 0.0;
  double high_mm = allowed_mm * (1.0 - 1e-9);  // no rounding of units puts it above what is allowed
  while (high_mm - low_mm > accuracy * allowed_mm) {
    const double middle_mm = 0.5 * (low_mm + high_mm);
    (FrechetDecision(ours, theirs, middle_mm).within() ? high_mm : low_mm) = middle_mm;
  }
  return high_mm;
}

std::optional<FeedDifference> feed_difference(const Cut& original, const Cut& emitted) {
  Sections ours(original);
  Sections theirs(emitted);
  // Of a path that is another one the sections are too: that is a difference of the paths.
  const bool same_length = same_section(original.length_mm, emitted.length_mm);
  for (;;) {
    Section a;
    Section b;
    const bool has_a = ours.next(a);
    const bool has_b = theirs.next(b);
    if (!has_a && !has_b) {
      return std::nullopt;
    }
    const bool same = has_a && has_b && std::abs(a.feed_mm_per_s - b.feed_mm_per_s) <= same_feed * a.feed_mm_per_s &&
                      (!same_length || same_section(a.length_mm, b.length_mm));
    if (!same) {
      return FeedDifference{a.line, b.line, a.feed_mm_per_s, b.feed_mm_per_s};
    }
  }
}

}  // namespace shapegcode::detail
