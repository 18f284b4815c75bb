#include "simulate/override_maxima.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace shapegcode::detail {
namespace {

// Largest error of a maximum: round-off of the bounds.
constexpr double slack_relative = 1e-10;
constexpr double slack_mm = 1e-10;
// So far before a section that counts a run begins: the trackers and the corners near its beginning are then those of a
// run from the path's start.
constexpr double run_in_mm = 1.0;
// In groups, about: of one with corners, and without.
constexpr std::size_t run_in_with_corners = 12;
constexpr std::size_t run_in_without = 2;
// Of the path over a group and its neighbours, where the piece beside a point is plain.
constexpr double max_turn_rad = 1.0;
// Groups that are followed before the others are walked along: their maxima settle many of these.
constexpr std::size_t followed_first = 4;

bool exceeds(double bound, double largest) noexcept {
  return bound > largest + std::max(slack_mm, slack_relative * largest);
}

}  // namespace

OverrideMaxima::OverrideMaxima(const Path& path, const Segments& blocks, const std::vector<BlockGroup>& groups,
                               const CornerReach& corners, const ContourTracker& tracker, BlockEnd block_end,
                               const SimulationOptions& options)
    : path_(path),
      blocks_(blocks),
      groups_(groups),
      block_end_(block_end),
      options_(options),
      modes_(options.modes, options.period_s),
      command_tracker_(tracker),
      response_tracker_(tracker),
      command_reach_(corners),
      response_reach_(corners) {}

OverrideFigures OverrideMaxima::at(double override_ratio) {
  figures_ = {override_ratio, 0.0, 0.0};
  if (groups_.empty()) {
    return figures_;  // rounded to blocks that go nowhere
  }
  const BlockInterpolator interpolator(blocks_, options_.period_s, block_end_, override_ratio);
  followed_.assign(groups_.size(), false);
  starts_.resize(groups_.size());
  states_.resize(groups_.size() * modes_.size());
  deflection_mm_.assign(groups_.size(), 0.0);
  response_mm_.resize(groups_.size());
  pass(interpolator);
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    response_mm_[group] = std::max(groups_[group].bound_mm, groups_[group].corner_mm) + deflection_mm_[group];
  }
  is_walked_ = false;
  search(interpolator, followed_first);
  walk(interpolator);
  is_walked_ = true;
  search(interpolator, groups_.size());
  return figures_;
}

void OverrideMaxima::pass(BlockInterpolator interpolator) {
  modes_.reset();
  const double rate_hz = 1.0 / options_.period_s;
  Vector3 position = Vector3::Zero();
  Vector3 last = position;
  double largest2 = 0.0;
  bool started = false;
  std::size_t group = 0;
  const auto begin_group = [&] {
    starts_[group] = {interpolator.block(), interpolator.elapsed_s(), modes_.velocity_mm_per_s()};
    modes_.save(std::span(states_).subspan(group * modes_.size(), modes_.size()));
  };
  while (interpolator.step(position)) {
    if (!started) {
      started = true;
      begin_group();
    } else {
      const double reachable2 = modes_.step((position - last) * rate_hz, 1);
      largest2 = std::max(largest2, reachable2);
      while (group + 1 < groups_.size() && groups_[group + 1].is_reached(interpolator)) {
        deflection_mm_[group] = std::sqrt(largest2);
        ++group;
        begin_group();
        largest2 = reachable2;
      }
    }
    last = position;
    const Segment& block = interpolator.on();
    const bool ends_on_block = group + 1 < groups_.size() && groups_[group + 1].first_block == interpolator.block();
    const double from_mm = interpolator.along_mm();
    const std::size_t periods = ends_on_block ? interpolator.pass_block(position, groups_[group + 1].along_mm)
                                              : interpolator.pass_block(position);
    if (periods == 0) {
      continue;
    }
    if (block.kind == SegmentKind::arc) {
      largest2 = std::max(largest2, turn(block, from_mm, interpolator.along_mm(), periods));
    } else {
      const Vector3 velocity = (position - last) * (rate_hz / static_cast<double>(periods));
      largest2 = std::max(largest2, modes_.step(velocity, periods));
    }
    last = position;
  }
  deflection_mm_[group] = std::sqrt(largest2);
}

// So many equal steps along an arc: its radius turns by the same angle in each.
double OverrideMaxima::turn(const Segment& arc, double from_mm, double to_mm, std::size_t periods) noexcept {
  const double steps = static_cast<double>(periods);
  const double fraction = (to_mm - from_mm) / arc.length_mm / steps;
  const double cosine = std::cos(arc.sweep_rad * fraction);
  const double sine = std::sin(arc.sweep_rad * fraction);
  const double growth_mm = (arc.end_radius_mm - arc.start_radius_mm) * fraction;
  const double rate_hz = 1.0 / options_.period_s;
  const int n = arc.normal;
  const int a = (n + 1) % axis_count;
  const int b = (n + 2) % axis_count;
  const double angle = arc.start_angle_rad + arc.sweep_rad * from_mm / arc.length_mm;
  double radius = arc.start_radius_mm + (arc.end_radius_mm - arc.start_radius_mm) * from_mm / arc.length_mm;
  double along = std::cos(angle);
  double across = std::sin(angle);
  Vector3 velocity;
  velocity[n] = (arc.end_mm[n] - arc.start_mm[n]) * fraction * rate_hz;
  double largest2 = 0.0;
  for (std::size_t k = 0; k < periods; ++k) {
    const double next_along = cosine * along - sine * across;
    const double next_across = sine * along + cosine * across;
    velocity[a] = ((radius + growth_mm) * next_along - radius * along) * rate_hz;
    velocity[b] = ((radius + growth_mm) * next_across - radius * across) * rate_hz;
    largest2 = std::max(largest2, modes_.step(velocity, 1));
    along = next_along;
    across = next_across;
    radius += growth_mm;
  }
  return largest2;
}

bool OverrideMaxima::may_hold_command(std::size_t group) const noexcept {
  return exceeds(std::max(groups_[group].bound_mm, groups_[group].corner_mm), figures_.command_mm);
}

bool OverrideMaxima::may_hold_response(std::size_t group) const noexcept {
  return exceeds(response_mm_[group], figures_.response_mm);
}

Vector3 OverrideMaxima::begin_at(BlockInterpolator& interpolator, std::size_t group) noexcept {
  const GroupStart& start = starts_[group];
  modes_.load(std::span(states_).subspan(group * modes_.size(), modes_.size()), start.velocity_mm_per_s);
  return interpolator.begin_on(start.block, start.elapsed_s);
}

// The distance from any piece of path near by is a bound; where the path turns, the tracker may hold to another one.
void OverrideMaxima::walk(BlockInterpolator interpolator) {
  PathWalk path(path_);
  const double rate_hz = 1.0 / options_.period_s;
  const auto is_walked = [&](std::size_t group) {
    double turn_rad = groups_[group].turn_rad;
    if (group > 0) {
      turn_rad += groups_[group - 1].turn_rad;
    }
    if (group + 1 < groups_.size()) {
      turn_rad += groups_[group + 1].turn_rad;
    }
    return turn_rad < max_turn_rad && !followed_[group] && may_hold_response(group);
  };
  Vector3 position = Vector3::Zero();
  for (std::size_t group = 0; group < groups_.size();) {
    if (!is_walked(group)) {
      ++group;
      continue;
    }
    position = begin_at(interpolator, group);
    path.begin_at(groups_[group].s_mm);
    double largest2 = path.distance2_mm2(position + modes_.deflection());
    const auto end_group = [&] {
      const double corner = groups_[group].has_corners() ? groups_[group].corner_mm + deflection_mm_[group] : 0.0;
      response_mm_[group] = std::min(response_mm_[group], std::max(std::sqrt(largest2), corner));
      largest2 = 0.0;
      ++group;
    };
    Vector3 before = position;
    bool more = true;
    while (more && interpolator.step(position)) {
      modes_.step((position - before) * rate_hz);
      before = position;
      const double distance2 = path.distance2_mm2(position + modes_.deflection());
      while (more && group + 1 < groups_.size() && groups_[group + 1].is_reached(interpolator)) {
        end_group();
        more = is_walked(group);
      }
      largest2 = std::max(largest2, distance2);
    }
    if (more) {
      end_group();
    }
  }
}

void OverrideMaxima::search(const BlockInterpolator& interpolator, std::size_t most) {
  std::vector<std::pair<double, std::size_t>> open;
  std::size_t run_in = 0;  // groups that would be followed, with those before each of them
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    if (may_hold_more(group)) {
      open.emplace_back(response_mm_[group], group);
      run_in += groups_[group].has_corners() ? run_in_with_corners : run_in_without;
    }
  }
  if (is_walked_ && run_in > 2 * groups_.size()) {
    follow(interpolator, 0, groups_.size() - 1);  // that is less
    return;
  }
  std::make_heap(open.begin(), open.end());
  for (std::size_t followed = 0; followed < most && !open.empty();) {
    std::pop_heap(open.begin(), open.end());
    const std::size_t group = open.back().second;
    open.pop_back();
    if (may_hold_more(group)) {
      follow(interpolator, group, group);
      ++followed;
    }
  }
}

// Group from whose first set-point on everything is as in a run from the start, once `group` is reached.
std::size_t OverrideMaxima::restart_before(std::size_t group) const noexcept {
  double needed_mm = groups_[group].s_mm - run_in_mm;
  const double window_mm = CornerReach::window_mm + run_in_mm;
  if (groups_[group].has_corners()) {
    const double corner_mm = groups_[group].first_corner_mm;
    needed_mm = std::min(needed_mm, corner_mm - window_mm);
    // A corner that seems missed keeps those behind it waiting.
    for (std::size_t k = group; k > 0 && groups_[k].s_mm > corner_mm - CornerReach::patience_mm; --k) {
      const BlockGroup& before = groups_[k - 1];
      if (before.has_corners() && before.corner_mm + deflection_mm_[k - 1] > CornerReach::missed_mm) {
        needed_mm = std::min(needed_mm, before.first_corner_mm - window_mm);
      }
    }
  }
  while (group > 0 && groups_[group].s_mm > needed_mm) {
    --group;
  }
  return group;
}

void OverrideMaxima::follow(BlockInterpolator interpolator, std::size_t first, std::size_t last) {
  std::size_t group = restart_before(first);
  double corner_mm = groups_[last].last_corner_mm;
  const double rate_hz = 1.0 / options_.period_s;
  const double start_mm = groups_[group].s_mm;
  Vector3 position = begin_at(interpolator, group);
  Vector3 before = position;
  command_tracker_.begin_at(start_mm, position);
  response_tracker_.begin_at(start_mm, position + modes_.deflection());
  command_reach_.begin_at(start_mm, group == 0);
  response_reach_.begin_at(start_mm, group == 0);
  bool ended = false;
  bool moved = false;
  for (;;) {
    if (moved) {
      modes_.step((position - before) * rate_hz);
      before = position;
    }
    moved = true;
    while (group + 1 < groups_.size() && groups_[group + 1].is_reached(interpolator)) {
      ++group;
      if (is_walked_ && group == last + 1 && may_hold_more(group)) {
        last = group;
        corner_mm = std::max(corner_mm, groups_[group].last_corner_mm);
      }
    }
    const Vector3 response = position + modes_.deflection();
    const double command_off = std::abs(command_tracker_.step(position));
    const double response_off = std::abs(response_tracker_.step(response, command_tracker_));
    command_reach_.step(position, command_tracker_.s_mm());
    response_reach_.step(response, response_tracker_.s_mm());
    if (group >= first && group <= last) {
      figures_.command_mm = std::max(figures_.command_mm, command_off);
      figures_.response_mm = std::max(figures_.response_mm, response_off);
    }
    const bool passed = command_reach_.has_passed(corner_mm) && response_reach_.has_passed(corner_mm);
    if (group > last && passed) {
      break;
    }
    if (!interpolator.step(position)) {
      ended = true;
      break;
    }
  }
  const auto missed = [ended](const CornerReach& reach) {
    return ended ? reach.largest_mm() : reach.largest_passed_mm();
  };
  figures_.command_mm = std::max(figures_.command_mm, missed(command_reach_));
  figures_.response_mm = std::max(figures_.response_mm, missed(response_reach_));
  std::fill(followed_.begin() + static_cast<std::ptrdiff_t>(first),
            followed_.begin() + static_cast<std::ptrdiff_t>(last) + 1, true);
}

}  // namespace shapegcode::detail
