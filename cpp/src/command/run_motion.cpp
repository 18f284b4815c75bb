#include "command/run_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "motion/feed_sections.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/planner.hpp"

namespace shapegcode {
namespace {

// Fraction of the contour tolerance for corner rounding; the rest is for the shaper's distortion. With contour
// compensation that distortion is small, without it large.
constexpr double rounding_share = 0.75;
constexpr double rounding_share_uncompensated = 0.25;
// Without a tolerance corners are rounded as for this one.
constexpr double largest_rounding_mm = 0.05;
// The feed is reached from rest, with full jerk up and down, in twice as many periods at least: in fewer a motion of
// one jerk a period cannot keep a feed.
constexpr double periods_to_feed = 6.0;
// Set-points that are planned for one row, at most.
constexpr std::size_t finest = 16;
// The planner finds no motion for a path in a hundred made to break it: then half the period is tried, so often, and
// after that the ramps of the look-ahead.
constexpr int halvings = 2;

class ProfileReader : public RunRowsReader {
 public:
  ProfileReader(const std::shared_ptr<const Path>& path, std::shared_ptr<const SpeedProfile> profile, double half_s,
                std::size_t steps_per_half, double delay_s)
      : path_(path),
        steps_(path, std::move(profile), half_s / static_cast<double>(steps_per_half), delay_s),
        steps_per_half_(steps_per_half) {}

  void next(Vector3& position) override {
    steps_.step(position, is_first_ ? 1 : steps_per_half_);
    is_first_ = false;
  }
  [[nodiscard]] std::size_t segment() const noexcept override { return steps_.segment(); }
  [[nodiscard]] const Segment& on() const noexcept override { return steps_.on(); }
  [[nodiscard]] Vector3 tangent() const noexcept override {
    return tangent_at(steps_.on(), steps_.distance_mm() - path_->distance_mm(steps_.segment()));
  }

 private:
  std::shared_ptr<const Path> path_;
  Interpolator steps_;
  std::size_t steps_per_half_;
  bool is_first_ = true;
};

class ProfileMotion : public RunMotion {
 public:
  ProfileMotion(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                std::size_t steps_per_half)
      : path_(std::move(path)), profile_(std::move(profile)), steps_per_half_(steps_per_half) {}

  [[nodiscard]] double duration_s() const noexcept override { return profile_->duration_s(); }
  [[nodiscard]] std::size_t block_periods(double half_period_s) const override {
    const double step_s = half_period_s / static_cast<double>(steps_per_half_);
    const std::size_t steps_per_period = 2 * steps_per_half_;
    return (Interpolator(path_, profile_, step_s).sample_count() - 1 + steps_per_period - 1) / steps_per_period;
  }
  [[nodiscard]] std::unique_ptr<RunRowsReader> read(double half_period_s, double delay_s) const override {
    return std::make_unique<ProfileReader>(path_, profile_, half_period_s, steps_per_half_, delay_s);
  }
  [[nodiscard]] double entered_s(std::size_t segment, std::size_t& cursor) const override {
    return profile_->time_s(path_->distance_mm(segment), cursor) + 0.5 * profile_->jerk_time_s();
  }

 private:
  std::shared_ptr<const Path> path_;
  std::shared_ptr<const SpeedProfile> profile_;
  std::size_t steps_per_half_;
};

// Set-points, one every half block period, with their segments of the path.
struct PlannedRows {
  std::shared_ptr<const Path> path;
  std::vector<Vector3> positions;
  std::vector<std::uint32_t> segments;
};

class PlannedReader : public RunRowsReader {
 public:
  PlannedReader(std::shared_ptr<const PlannedRows> rows, double delay_rows)
      : rows_(std::move(rows)), delay_(delay_rows) {
    take(0);
  }

  void next(Vector3& position) override {
    const double at = static_cast<double>(row_++) - delay_;
    const auto whole = static_cast<std::ptrdiff_t>(std::floor(at));
    const double part = at - static_cast<double>(whole);
    position = between(whole, part);
    take(rows_->segments[static_cast<std::size_t>(index(whole))]);
    const Vector3 step = rows_->positions[static_cast<std::size_t>(index(whole + 1))] -
                         rows_->positions[static_cast<std::size_t>(index(part > 0.0 ? whole : whole - 1))];
    const double length = step.norm();
    if (length > least_step_mm) tangent_ = step / length;
  }
  [[nodiscard]] std::size_t segment() const noexcept override { return segment_; }
  [[nodiscard]] const Segment& on() const noexcept override { return on_; }
  [[nodiscard]] Vector3 tangent() const noexcept override { return tangent_; }

 private:
  static constexpr double least_step_mm = 1e-7;  // below it the direction is that of before

  [[nodiscard]] std::ptrdiff_t index(std::ptrdiff_t row) const noexcept {
    return std::clamp<std::ptrdiff_t>(row, 0, std::ssize(rows_->positions) - 1);
  }
  // Cubic through the four set-points around: of a motion with so little jerk, to a fraction of a micrometre.
  [[nodiscard]] Vector3 between(std::ptrdiff_t row, double part) const noexcept {
    const auto at = [&](std::ptrdiff_t k) -> const Vector3& {
      return rows_->positions[static_cast<std::size_t>(index(k))];
    };
    if (part == 0.0) return at(row);
    const double a = part + 1.0;
    const double b = part;
    const double c = part - 1.0;
    const double d = part - 2.0;
    return at(row - 1) * (-b * c * d / 6.0) + at(row) * (a * c * d / 2.0) + at(row + 1) * (-a * b * d / 2.0) +
           at(row + 2) * (a * b * c / 6.0);
  }
  void take(std::uint32_t segment) noexcept {
    if (row_ > 1 && segment == segment_) return;
    segment_ = segment;
    on_ = (*rows_->path)[segment];
    if (row_ <= 1) tangent_ = tangent_at(on_, 0.0);
  }

  std::shared_ptr<const PlannedRows> rows_;
  double delay_;
  std::size_t row_ = 0;
  std::uint32_t segment_ = 0;
  Segment on_;
  Vector3 tangent_ = Vector3::Zero();
};

class PlannedMotion final : public RunMotion {
 public:
  PlannedMotion(std::shared_ptr<const PlannedRows> rows, double half_period_s, double rounding_mm)
      : rows_(std::move(rows)), half_period_s_(half_period_s), rounding_mm_(rounding_mm) {
    passed_.on_segment.assign(rows_->path->size(), 0.0F);
    passed_.at_junction.assign(rows_->path->size(), 0.0F);
    const auto& [path, positions, segments] = *rows_;
    for (std::size_t k = 1; k < positions.size(); ++k) {
      const auto speed = static_cast<float>((positions[k] - positions[k - 1]).norm() / half_period_s);
      float& on = passed_.on_segment[segments[k]];
      on = std::max(on, speed);
      for (std::size_t i = segments[k - 1] + 1; i <= segments[k]; ++i) {
        passed_.at_junction[i] = std::max(passed_.at_junction[i], speed);
        passed_.on_segment[i] = std::max(passed_.on_segment[i], speed);
      }
    }
  }

  [[nodiscard]] double duration_s() const noexcept override {
    return static_cast<double>(rows_->positions.size() - 1) * half_period_s_;
  }
  [[nodiscard]] std::size_t block_periods(double) const override { return rows_->positions.size() / 2; }
  [[nodiscard]] std::unique_ptr<RunRowsReader> read(double half_period_s, double delay_s) const override {
    return std::make_unique<PlannedReader>(rows_, delay_s / half_period_s);
  }
  [[nodiscard]] double entered_s(std::size_t segment, std::size_t& cursor) const override {
    while (cursor + 1 < rows_->segments.size() && rows_->segments[cursor] < segment) ++cursor;
    return static_cast<double>(cursor) * half_period_s_;
  }
  [[nodiscard]] double rounding_mm() const noexcept override { return rounding_mm_; }
  [[nodiscard]] const SpeedCaps* passed() const noexcept override { return &passed_; }

 private:
  std::shared_ptr<const PlannedRows> rows_;
  double half_period_s_;
  double rounding_mm_;
  SpeedCaps passed_;
};

// Every so many set-points, and the last.
PlannedRows rows_of(const TimeOptimalMotion& motion, const FeedSections& sections, std::size_t every) {
  PlannedRows rows;
  const Eigen::MatrixXd& points = motion.set_points.positions_mm;
  const auto count = static_cast<std::size_t>(points.rows());
  for (std::size_t k = 0; k < count + every - 1; k += every) {
    const std::size_t at = std::min(k, count - 1);
    rows.positions.emplace_back(points.row(static_cast<Eigen::Index>(at)));
    rows.segments.push_back(sections.segments[motion.segments[at]]);
  }
  return rows;
}

// Set-points to be planned for one row, so that the slowest section is long enough under way to its feed. Where that
// would be too many, less jerk is planned.
std::size_t finer_steps(const Path& sections, double half_period_s, Vector3& max_jerk_mm_per_s3) {
  double slowest = MotionLimits::none;
  for (const Segment& section : sections.segments()) slowest = std::min(slowest, section.feed_mm_per_s);
  const double wanted_s = std::sqrt(slowest / max_jerk_mm_per_s3.maxCoeff()) / periods_to_feed;
  const double steps = std::clamp(std::ceil(half_period_s / wanted_s), 1.0, static_cast<double>(finest));
  const double time_s = periods_to_feed * half_period_s / steps;
  max_jerk_mm_per_s3 = max_jerk_mm_per_s3.cwiseMin(slowest / (time_s * time_s));
  return static_cast<std::size_t>(steps);
}

void require_axis_limits(const MotionLimits& limits) {
  for (int i = 0; i < axis_count; ++i) {
    if (std::isfinite(limits.max_feed_mm_per_s[i]) && std::isfinite(limits.max_acceleration_mm_per_s2[i]) &&
        std::isfinite(limits.max_jerk_mm_per_s3[i])) {
      continue;
    }
    throw Error(ErrorKind::argument,
                fmt::format("the time-optimal planner needs limits of feed, acceleration and jerk of every axis: {} "
                            "has {} mm/s, {} mm/s2, {} mm/s3",
                            "XYZ"[i], limits.max_feed_mm_per_s[i], limits.max_acceleration_mm_per_s2[i],
                            limits.max_jerk_mm_per_s3[i]));
  }
}

// Rules of a control's look-ahead that stand for what this planner looks at itself: how corners are passed, and what
// the axes can do.
MotionLimits without_corner_rules(MotionLimits limits) {
  limits.corner_speed_difference_mm_per_s.setConstant(MotionLimits::none);
  limits.corner_stop_angle_rad = MotionLimits::none;
  limits.junction_deviation_mm = MotionLimits::none;
  limits.block_time_s = 0.0;
  limits.max_acceleration_mm_per_s2.setConstant(MotionLimits::none);
  limits.max_jerk_mm_per_s3.setConstant(MotionLimits::none);
  limits.law = AccelerationLaw::jerk_limited;
  return limits;
}

}  // namespace

std::shared_ptr<const RunMotion> motion_of(std::shared_ptr<const Path> path,
                                           std::shared_ptr<const SpeedProfile> profile, std::size_t steps_per_half) {
  return std::make_shared<const ProfileMotion>(std::move(path), std::move(profile), steps_per_half);
}

RunPlanner::RunPlanner(const ShapingOptions& options, double spread_s)
    : kind_(options.planner),
      limits_(options.limits),
      rules_(options.limits),
      tolerance_(options.tolerance),
      target_(options.target),
      half_period_s_(0.5 * options.block_period_s),
      spread_s_(spread_s) {
  const double ticks = options.block_period_s / options.interpolation_period_s;
  if (!(ticks >= 1.0 - 1e-9) || !(std::abs(ticks - std::round(ticks)) <= 1e-6)) {
    throw Error(ErrorKind::argument,
                fmt::format("block period {} s is not a whole multiple of the interpolation period {} s",
                            options.block_period_s, options.interpolation_period_s));
  }
  // The middle of an odd number of ticks lies between two of them.
  const auto whole = static_cast<std::size_t>(std::lround(ticks));
  steps_per_half_ = whole % 2 == 0 ? whole / 2 : whole;
  if (kind_ == CommandPlanner::time_optimal) {
    require_axis_limits(limits_);
    rules_ = without_corner_rules(limits_);
    const double share = target_ == ContourTarget::none ? rounding_share_uncompensated : rounding_share;
    rounding_mm_ = share * std::min(tolerance_.contour_tolerance_mm, largest_rounding_mm);
  }
}

FilterTolerance RunPlanner::left_to_filter() const noexcept {
  FilterTolerance left = target_ == ContourTarget::none ? tolerance_ : FilterTolerance{};
  left.contour_tolerance_mm -= rounding_mm_;
  return left;
}

std::shared_ptr<const RunMotion> RunPlanner::plan(const std::shared_ptr<const Path>& path,
                                                  const SpeedCaps* caps) const {
  const bool moves = path->length_mm() > 0.0;
  return kind_ == CommandPlanner::time_optimal && moves ? time_optimal(path, caps) : along_path(path, caps);
}

std::shared_ptr<const RunMotion> RunPlanner::along_path(const std::shared_ptr<const Path>& path,
                                                        const SpeedCaps* caps) const {
  auto profile = std::make_shared<const SpeedProfile>(plan_speed(*path, limits_, left_to_filter(), caps));
  return motion_of(path, std::move(profile), steps_per_half_);
}

std::shared_ptr<const RunMotion> RunPlanner::time_optimal(const std::shared_ptr<const Path>& path,
                                                          const SpeedCaps* caps) const {
  const FeedSections sections = feed_sections(*path, rules_, left_to_filter(), caps, 2.0 * spread_s_);
  TrajectoryLimits limits{limits_.max_feed_mm_per_s, limits_.max_acceleration_mm_per_s2, limits_.max_jerk_mm_per_s3,
                          rounding_mm_};
  std::size_t every = finer_steps(sections.path, half_period_s_, limits.max_jerk_mm_per_s3);
  for (int n = 0;; ++n, every *= 2) {
    try {
      const double step_s = half_period_s_ / static_cast<double>(every);
      PlannedRows rows = rows_of(time_optimal_motion(sections.path, limits, step_s), sections, every);
      rows.path = path;
      return std::make_shared<const PlannedMotion>(std::make_shared<const PlannedRows>(std::move(rows)), half_period_s_,
                                                   rounding_mm_);
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::numeric) throw;
      if (n == halvings) return along_path(path, caps);
    }
  }
}

}  // namespace shapegcode
