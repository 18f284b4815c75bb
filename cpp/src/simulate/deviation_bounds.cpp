#include "simulate/deviation_bounds.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace shapegcode::detail {
namespace {

constexpr double group_mm = 2.0;

// A curve of a length between two points lies in an ellipse about them: no point of the straight line between them is
// further from it than its half minor axis, and no point of it further from the line. Rounding of both included.
double farthest_from_chord(double length_mm, double chord_mm, double rounding_mm) noexcept {
  const double length = length_mm + rounding_mm;
  return 0.5 * std::sqrt(std::max(0.0, length * length - chord_mm * chord_mm));
}

// The same of an arc.
double farthest_from_chord_of_arc(double length_mm, double curvature_per_mm) noexcept {
  // R (1 - cos(a / 2)) <= R a^2 / 8, and no more than half the length.
  return std::min(0.5 * length_mm, 0.125 * length_mm * length_mm * curvature_per_mm);
}

}  // namespace

DeviationBounds::DeviationBounds(const Path& path, Segments blocks, BlockEnd block_end, double largest_override)
    : path_(path),
      blocks_(std::move(blocks)),
      block_end_(block_end),
      largest_override_(std::max(1.0, largest_override)),
      corners_(path) {}

double DeviationBounds::travel_mm(const Sample& before, const Sample& now) const noexcept {
  if (before.block == now.block) {
    return now.along_mm - before.along_mm;
  }
  double travel = blocks_[before.block].length_mm - before.along_mm + now.along_mm;
  for (std::size_t i = before.block + 1; i < now.block; ++i) {
    travel += blocks_[i].length_mm;
  }
  return travel;
}

// Between the feet of two set-points the path leaves their chord by so much, and so do the blocks between the
// set-points; between the chords the distance is largest at an end.
double DeviationBounds::bound_between(const Sample& before, const Sample& now) const noexcept {
  double bound = std::max(before.deviation_mm, now.deviation_mm);
  if (before.block == now.block && before.segment == now.segment && curvature_ == 0.0 && path_curvature_ == 0.0) {
    return bound;
  }
  if (before.segment == now.segment) {
    bound += farthest_from_chord_of_arc(std::abs(now.s_mm - before.s_mm), path_curvature_);
  } else {
    std::size_t from = before.segment;
    std::size_t to = now.segment;
    const double chord = (path_.point(now.s_mm, to) - path_.point(before.s_mm, from)).norm();
    bound += farthest_from_chord(std::abs(now.s_mm - before.s_mm), chord, 1e-15 * std::abs(now.s_mm));
  }
  const bool ends_in_step = now.block == before.block + 1 && now.along_mm == 0.0;
  if (before.block == now.block || ends_in_step) {
    bound += farthest_from_chord_of_arc(travel_mm(before, now), ends_in_step ? curvature_before_ : curvature_);
  } else {
    bound += farthest_from_chord(travel_mm(before, now), (now.p - before.p).norm(), 1e-14);
  }
  return bound;
}

double DeviationBounds::turn_rad(const Sample& before, const Sample& now) const noexcept {
  if (before.segment == now.segment) {
    return path_curvature_ * std::abs(now.s_mm - before.s_mm);
  }
  const auto [first, last] = std::minmax(before.segment, now.segment);
  double turn = 0.0;
  for (std::size_t i = first; i < last; ++i) {
    const Segment leg = path_[i];
    const double cosine = tangent_at(leg, leg.length_mm).dot(tangent_at(path_[i + 1], 0.0));
    turn += std::acos(std::clamp(cosine, -1.0, 1.0)) + curvature(leg) * leg.length_mm;
  }
  return turn;
}

// The track between set-points is straight, on a faster run over a longer distance.
void DeviationBounds::widen_track(const Sample& now) noexcept {
  const bool straight = curvature_ == 0.0 && curvature_before_ == 0.0;
  if (!corners_.is_near() || (straight && (block_end_ == BlockEnd::ceil || now.block == last_.block))) {
    return;
  }
  // Half the travel of one step: a corner that it cuts is no further from it.
  const double step_mm = largest_override_ * travel_mm(last_, now);
  double sine = 1.0;
  if (now.block <= last_.block + 1) {
    const Segment before = blocks_[last_.block];
    const double turn = (curvature_ + curvature_before_) * step_mm;
    const double cosine = tangent_at(before, before.length_mm).dot(tangent_at(blocks_[now.block], 0.0));
    const double corner = now.block == last_.block ? 0.0 : std::sqrt(std::max(0.0, 0.5 * (1.0 - cosine)));
    sine = std::min(1.0, corner + 0.5 * turn);
  }
  chord_mm_.back() = std::max(chord_mm_.back(), step_mm * sine);
}

void DeviationBounds::add(const BlockInterpolator& interpolator, const Vector3& p, double deviation_mm,
                          const ContourTracker& tracker) {
  const Sample now{interpolator.block(),   interpolator.along_mm(), p,
                   std::abs(deviation_mm), tracker.s_mm(),          tracker.segment()};
  if (groups_.empty()) {
    curvature_ = curvature(interpolator.on());
    path_curvature_ = curvature(path_[now.segment]);
    groups_.push_back({.first_block = now.block, .s_mm = now.s_mm, .bound_mm = now.deviation_mm});
    chord_mm_.push_back(0.0);
  } else {
    curvature_before_ = curvature_;
    if (now.block != last_.block) {
      curvature_ = curvature(interpolator.on());
    }
    if (now.segment != last_.segment) {
      path_curvature_ = path_.is_arc(now.segment) ? curvature(path_[now.segment]) : 0.0;
    }
    const double bound = bound_between(last_, now);
    const double turn = turn_rad(last_, now);
    groups_.back().bound_mm = std::max(groups_.back().bound_mm, bound);
    groups_.back().turn_rad += turn;
    if (now.s_mm >= groups_.back().s_mm + group_mm) {
      groups_.push_back(
          {.first_block = now.block, .along_mm = now.along_mm, .s_mm = now.s_mm, .bound_mm = bound, .turn_rad = turn});
      chord_mm_.push_back(0.0);
    }
  }
  corners_.step(p, now.s_mm, static_cast<std::uint32_t>(groups_.size() - 1));
  widen_track(now);
  last_ = now;
}

const std::vector<BlockGroup>& DeviationBounds::finish() {
  for (const CornerReach::Corner& corner : corners_.corners()) {
    if (!std::isfinite(corner.best2)) {
      continue;
    }
    BlockGroup& group = groups_[corner.tag];
    double chord = chord_mm_[corner.tag];
    if (corner.tag > 0) {
      chord = std::max(chord, chord_mm_[corner.tag - 1]);
    }
    if (corner.tag + 1 < groups_.size()) {
      chord = std::max(chord, chord_mm_[corner.tag + 1]);
    }
    group.corner_mm = std::max(group.corner_mm, std::sqrt(corner.best2) + 2.0 * chord);
    group.first_corner_mm = std::min(group.first_corner_mm, corner.s);
    group.last_corner_mm = std::max(group.last_corner_mm, corner.s);
  }
  return groups_;
}

}  // namespace shapegcode::detail
