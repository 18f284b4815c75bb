#include "command/feed_search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "command/junctions.hpp"
#include "command/run_shaper.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {
namespace {

constexpr int rounds = 9;
constexpr int raising_rounds = 6;  // behind them speeds are only lowered
constexpr double aim = 0.97;       // of the tolerance, for the next round
constexpr double enough = 0.88;    // of the tolerance: what is used so far is not raised
constexpr double largest_raise = 1.25;
// A corner becomes a stop if its speed would be below this, or below this ratio of its first speed.
constexpr double creep_mm_per_s = 0.5;
constexpr double creep_share = 0.02;
// Curves and lines are never slowed below this share of their speed: what then still deviates is not the feed's doing.
constexpr double slowest_share = 0.05;
// A longer run is shaped once more when it is given out: so much memory (100 MB) is not spent on it.
constexpr std::size_t max_rows_kept = std::size_t{1} << 22U;
constexpr float none = std::numeric_limits<float>::infinity();

}  // namespace

FeedSearch::FeedSearch(std::shared_ptr<const Path> path, const RunLimits& limits, const RunFilter& filter,
                       const RunPlanner& planner, double tolerance_mm, double least_feed_mm_per_s)
    : path_(std::move(path)),
      limits_(limits),
      filter_(filter),
      planner_(planner),
      tolerance_(tolerance_mm),
      min_feed_(least_feed_mm_per_s),
      caps_{std::vector<float>(path_->size(), none), std::vector<float>(path_->size(), none)} {}

void FeedSearch::begin_round() {
  plan_ = {path_, planner_.plan(path_, &caps_), 0.0, {}, {}};
  deviation_.at_junction.assign(path_->size(), 0.0F);
  deviation_.on_segment.assign(path_->size(), -1.0F);
  deviation_.near_corner.assign(path_->size(), 0.0F);
  deviation_.largest = 0.0F;
  shaper_ = std::make_unique<RunShaper>(path_, plan_.motion, filter_, limits_, &deviation_);
  row_ = 0;
}

bool FeedSearch::next(Vector3& position) {
  shaper_->next(position);
  ++row_;
  return static_cast<double>(deviation_.largest) <= tolerance_;
}

PlannedRun FeedSearch::measured() {
  if (!shaper_) begin_round();
  const std::size_t rows = 2 * static_cast<std::size_t>(shaper_->periods()) + 1;
  const bool keeps = keeps_rows_ && row_ == 0 && rows <= max_rows_kept;
  Vector3 position;
  while (row_ < rows) {
    const std::size_t row = row_;
    next(position);
    if (!keeps) continue;
    plan_.rows.positions.push_back(position);
    if (row % 2 == 0 && row + 1 < rows) plan_.rows.arc_normals.push_back(shaper_->arc_normal());
  }
  shaper_.reset();
  plan_.largest_deviation_mm = deviation_.largest;
  return std::move(plan_);
}

PlannedRun FeedSearch::run() {
  PlannedRun best;
  PlannedRun last;
  for (int round = 0; round < rounds; ++round) {
    last.rows = {};
    last = measured();
    const bool within = last.largest_deviation_mm <= tolerance_;
    if (within && round == 0) return last;  // nothing was slowed, so nothing can be raised
    is_slowed_ = true;
    if (within && (!best.motion || last.motion->duration_s() < best.motion->duration_s())) {
      RunRows rows = std::move(last.rows);
      best = last;
      best.rows = std::move(rows);
    }
    bool changed = adjust(*last.motion, round < raising_rounds);
    if (!stops_.empty()) {
      last.stops = std::move(stops_);
      return last;
    }
    if (!within && (!changed || round >= raising_rounds) && planner_.rules().law == AccelerationLaw::constant_time) {
      changed = slow_lines() || changed;
    }
    if (!changed || (within && round >= raising_rounds)) {
      break;
    }
  }
  if (best.motion) {
    return best;
  }
  // Corners that do not answer to a lower speed: what bends them is the change of speed around them.
  for (std::size_t i = 1; i < path_->size(); ++i) {
    if (caps_.at_junction[i] < none && deviation_.at_junction[i] > tolerance_ &&
        junction_change((*path_)[i - 1], (*path_)[i]) >= corner_change) {
      last.stops.push_back(i);
    }
  }
  return last;
}

// Speed at which the next round may pass a position that was passed at `speed` with `deviation`, of which `own_mm` is
// not the speed's doing. Deviation grows with the square of the speed on curves, and at least with the speed at
// corners.
double FeedSearch::next_speed(double speed, double deviation, bool curve, double own_mm) const noexcept {
  const double left = tolerance_ - own_mm;
  const double share = aim * left / std::max(deviation - own_mm, 1e-3 * left);
  return speed * (curve ? std::sqrt(share) : share);
}

// New caps; false if none changed.
bool FeedSearch::adjust(const RunMotion& motion, bool raise) {
  bool changed = false;
  const MotionLimits& rules = planner_.rules();
  const SpeedCaps* passed_at = motion.passed();
  double own_mm = 0.0;
  const auto adjust_one = [&](float& cap, double speed, double deviation, bool curve, double least) {
    const bool capped = cap < none;
    if (deviation <= tolerance_ && !(capped && raise && deviation < enough * tolerance_)) {
      return;
    }
    double next = next_speed(speed, deviation, curve, own_mm);
    if (deviation <= tolerance_) {
      next = std::min(next, largest_raise * speed);
    } else if (next < least) {
      next = least;
      if (speed <= least) {
        return;
      }
    }
    cap = static_cast<float>(next);
    changed = true;
  };
  for (std::size_t i = 0; i < path_->size(); ++i) {
    const Segment segment = (*path_)[i];
    const double limit = segment_speed_limit(segment, rules);
    double speed = std::min(static_cast<double>(caps_.on_segment[i]), limit);
    if (passed_at != nullptr) speed = std::min(speed, static_cast<double>(passed_at->on_segment[i]));
    own_mm = 0.0;
    if (segment.kind == SegmentKind::arc) {
      const float clear = deviation_.on_segment[i];
      adjust_one(caps_.on_segment[i], speed, clear >= 0.0F ? clear : deviation_.near_corner[i], true, slowest(limit));
    }
    if (i == 0) {
      continue;
    }
    const Segment before = (*path_)[i - 1];
    const double change = junction_change(before, segment);
    if (change < 1e-6) {
      continue;  // an arc that begins or ends tangentially is slowed as a whole
    }
    const double first =
        std::min({corner_speed_limit(before, segment, rules), limit, segment_speed_limit(before, rules)});
    double passed = std::min(first, static_cast<double>(caps_.at_junction[i]));
    if (passed_at != nullptr) passed = std::min(passed, static_cast<double>(passed_at->at_junction[i]));
    own_mm = motion.rounding_mm();
    const bool is_curve = change < corner_change;
    adjust_one(caps_.at_junction[i], passed, deviation_.at_junction[i], is_curve, is_curve ? slowest(first) : 0.0);
    if (caps_.at_junction[i] < std::max(creep_mm_per_s, creep_share * first)) {
      stops_.push_back(i);
    }
  }
  return changed;
}

double FeedSearch::slowest(double speed) const noexcept {
  return std::min(speed, std::max(min_feed_, slowest_share * speed));
}

// Where neither arcs nor corners are to blame it is a ramp on a line across the axes, which bends the response of
// axes with different modes; a ramp of constant time is as steep as the feed is high.
bool FeedSearch::slow_lines() {
  bool changed = false;
  for (std::size_t i = 0; i < path_->size(); ++i) {
    const Segment segment = (*path_)[i];
    const auto deviation = static_cast<double>(deviation_.on_segment[i]);
    if (segment.kind == SegmentKind::arc || deviation <= tolerance_) {
      continue;
    }
    const double first = segment_speed_limit(segment, planner_.rules());
    const double speed = std::min(static_cast<double>(caps_.on_segment[i]), first);
    const double least = slowest(first);
    if (speed > least) {
      caps_.on_segment[i] = static_cast<float>(std::max(least, next_speed(speed, deviation, false, 0.0)));
      changed = true;
    }
  }
  return changed;
}

RunLimits run_limits(const MotionLimits& limits) {
  return {limits.max_feed_mm_per_s, limits.max_acceleration_mm_per_s2};
}

PlannedRun plan_within_tolerance(std::shared_ptr<const Path> path, const RunLimits& limits, const RunFilter& filter,
                                 const RunPlanner& planner, double tolerance_mm, double least_feed_mm_per_s) {
  return FeedSearch(std::move(path), limits, filter, planner, tolerance_mm, least_feed_mm_per_s).run();
}

}  // namespace shapegcode
