#include "play/override_maxima.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstdio>
#include <utility>

namespace shapegcode::detail {
namespace {

// What a maximum may be short of, and no more: rounding of the bounds.
constexpr double slack_relative = 1e-10;
constexpr double slack_mm = 1e-10;
// So far before a stretch that counts a run begins: the trackers and the corners near its beginning are then those of a
// run from the path's start.
constexpr double run_in_mm = 1.0;

// Groups that are followed before the others are walked along: their maxima settle many of these.
constexpr std::size_t followed_first = 4;

bool exceeds(double bound, double largest) noexcept {
  return bound > largest + std::max(slack_mm, slack_relative * largest);
}

}  // namespace

OverrideMaxima::OverrideMaxima(const Path& path, const Segments& blocks, const std::vector<BlockGroup>& groups,
                               const CornerReach& corners, const ContourTracker& tracker, BlockEnd block_end,
                               const PlaybackOptions& options)
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
  const BlockPlayer player(blocks_, options_.period_s, block_end_, override_ratio);
  followed_.assign(groups_.size(), false);
  places_.resize(groups_.size());
  states_.resize(groups_.size() * modes_.size());
  deflection_mm_.assign(groups_.size(), 0.0);
  response_mm_.resize(groups_.size());
  pass(player);
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    response_mm_[group] = std::max(groups_[group].bound_mm, groups_[group].corner_mm) + deflection_mm_[group];
  }
  is_walked_ = false;
  search(player, followed_first);
  auto show = [&](const char* what) {
    if (!getenv("DBG")) return;
    std::vector<double> r;
    for (std::size_t g = 0; g < groups_.size(); ++g) r.push_back(response_mm_[g]);
    std::sort(r.begin(), r.end());
    auto q = [](auto& v, double f) { return 1e3 * v[std::size_t(f * double(v.size() - 1))]; };
    fprintf(stderr, "  %s M %.2f %.2f; min %.2f 10%% %.2f med %.2f 90%% %.2f 99%% %.2f max %.2f\n", what, 1e3 * figures_.command_mm, 1e3 * figures_.response_mm, q(r, 0), q(r, .1), q(r, .5), q(r, .9), q(r, .99), q(r, 1));
  };
  show("before walk");
  walk(player);
  is_walked_ = true;
  show("after walk");
  search(player, groups_.size());
  if (getenv("DBG")) fprintf(stderr, "followed %zu of %zu, samples %zu\n", std::size_t(std::count(followed_.begin(), followed_.end(), true)), groups_.size(), samples_);
  return figures_;
}

void OverrideMaxima::pass(BlockPlayer player) {
  modes_.reset();
  const double rate_hz = 1.0 / options_.period_s;
  Vector3 position = Vector3::Zero();
  Vector3 last = position;
  double largest2 = 0.0;
  bool started = false;
  std::size_t group = 0;
  const auto begin_group = [&] {
    places_[group] = {player.block(), player.elapsed_s(), modes_.velocity_mm_per_s()};
    modes_.save(std::span(states_).subspan(group * modes_.size(), modes_.size()));
  };
  while (player.step(position)) {
    if (!started) {
      started = true;
      begin_group();
    } else {
      const double reachable2 = modes_.step((position - last) * rate_hz, 1);
      largest2 = std::max(largest2, reachable2);
      while (group + 1 < groups_.size() && player.block() >= groups_[group + 1].first_block) {
        deflection_mm_[group] = std::sqrt(largest2);
        ++group;
        begin_group();
        largest2 = reachable2;
      }
    }
    last = position;
    const std::size_t periods = player.pass_line(position);
    if (periods > 0) {
      const Vector3 velocity = (position - last) * (rate_hz / static_cast<double>(periods));
      largest2 = std::max(largest2, modes_.step(velocity, periods));
      last = position;
    }
  }
  deflection_mm_[group] = std::sqrt(largest2);
}

bool OverrideMaxima::may_hold_command(std::size_t group) const noexcept {
  return exceeds(std::max(groups_[group].bound_mm, groups_[group].corner_mm), figures_.command_mm);
}

bool OverrideMaxima::may_hold_response(std::size_t group) const noexcept {
  return exceeds(response_mm_[group], figures_.response_mm);
}

Vector3 OverrideMaxima::begin_at(BlockPlayer& player, std::size_t group) noexcept {
  const Place& place = places_[group];
  modes_.load(std::span(states_).subspan(group * modes_.size(), modes_.size()), place.velocity_mm_per_s);
  return player.begin_on(place.block, place.elapsed_s);
}

// The distance from any piece of path near by is a bound; beside sharp corners the tracker may hold to another leg.
void OverrideMaxima::walk(BlockPlayer player) {
  PathWalk path(path_);
  const double rate_hz = 1.0 / options_.period_s;
  const auto is_walked = [&](std::size_t group) {
    const bool turns_back = groups_[group].turns_back || (group > 0 && groups_[group - 1].turns_back) ||
                            (group + 1 < groups_.size() && groups_[group + 1].turns_back);
    return !turns_back && !followed_[group] && may_hold_response(group);
  };
  Vector3 position = Vector3::Zero();
  for (std::size_t group = 0; group < groups_.size();) {
    if (!is_walked(group)) {
      ++group;
      continue;
    }
    position = begin_at(player, group);
    path.begin_at(groups_[group].s_mm);
    double largest2 = path.distance2_mm2(position + modes_.deflection());
    const auto end_group = [&] {
      const double corner = groups_[group].corner_mm > 0.0 ? groups_[group].corner_mm + deflection_mm_[group] : 0.0;
      response_mm_[group] = std::min(response_mm_[group], std::max(std::sqrt(largest2), corner));
      largest2 = 0.0;
      ++group;
    };
    Vector3 before = position;
    bool more = true;
    while (more && player.step(position)) {
      modes_.step((position - before) * rate_hz);
      before = position;
      const double distance2 = path.distance2_mm2(position + modes_.deflection());
      while (more && group + 1 < groups_.size() && player.block() >= groups_[group + 1].first_block) {
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

void OverrideMaxima::search(const BlockPlayer& player, std::size_t most) {
  std::vector<std::pair<double, std::size_t>> open;
  std::size_t run_in = 0;  // groups that are followed at most, those before each of them too
  for (std::size_t group = 0; group < groups_.size(); ++group) {
    if (may_hold_more(group)) {
      open.emplace_back(response_mm_[group], group);
      run_in += groups_[group].has_corners() ? 12 : 2;
    }
  }
  if (is_walked_ && run_in > 2 * groups_.size()) {
    follow(player, 0, groups_.size() - 1);  // that is less
    return;
  }
  std::make_heap(open.begin(), open.end());
  for (std::size_t followed = 0; followed < most && !open.empty();) {
    std::pop_heap(open.begin(), open.end());
    const std::size_t group = open.back().second;
    open.pop_back();
    if (may_hold_more(group)) {
      follow(player, group, group);
      ++followed;
    }
  }
}

// Group from whose first set-point on everything is as in a run from the start, once `group` is reached.
std::size_t OverrideMaxima::restart_before(std::size_t group) const noexcept {
  double needed_mm = groups_[group].s_mm - run_in_mm;
  if (groups_[group].has_corners()) {
    needed_mm = std::min(needed_mm, groups_[group].first_corner_mm - CornerReach::window_mm - run_in_mm);
  }
  const double reach_mm = groups_[group].s_mm - CornerReach::patience_mm;
  std::size_t from = group;
  while (from > 0 && groups_[from].s_mm > std::min(needed_mm, reach_mm)) {
    --from;
    // A corner that seems missed keeps those behind it waiting.
    const BlockGroup& before = groups_[from];
    if (groups_[group].has_corners() && before.has_corners() &&
        before.bound_mm + deflection_mm_[from] > CornerReach::missed_mm) {
      needed_mm = std::min(needed_mm, before.first_corner_mm - CornerReach::window_mm - run_in_mm);
    }
  }
  std::size_t restart = group;
  while (restart > 0 && groups_[restart].s_mm > needed_mm) {
    --restart;
  }
  return restart;
}

void OverrideMaxima::follow(BlockPlayer player, std::size_t first, std::size_t last) {
  std::size_t group = restart_before(first);
  double corner_mm = groups_[last].last_corner_mm;
  const double rate_hz = 1.0 / options_.period_s;
  const double start_mm = groups_[group].s_mm;
  Vector3 position = begin_at(player, group);
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
    while (group + 1 < groups_.size() && player.block() >= groups_[group + 1].first_block) {
      ++group;
      if (is_walked_ && group == last + 1 && may_hold_more(group)) {
        last = group;
        corner_mm = std::max(corner_mm, groups_[group].last_corner_mm);
      }
    }
    ++samples_;
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
    if (!player.step(position)) {
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
