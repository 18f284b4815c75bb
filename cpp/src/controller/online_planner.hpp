// The look-ahead of a control: successive sections of motion, each followed by a planned stop.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "controller/contour_check.hpp"
#include "controller/sections.hpp"
#include "planner/path_motion.hpp"
#include "planner/path_plan.hpp"

namespace shapegcode {

/// What a control plans with.
struct PlanningRules {
  double period_s = 0.001;
  AxisLimits limits;             ///< that the set-points keep
  double max_across = no_limit;  ///< acceleration across the path
  std::size_t window = 128;      ///< segments that are planned ahead
  bool is_open = false;          ///< with as many stations as that takes, which are allocated when they are needed
  int lead_periods = 0;          ///< that are planned before they are run
  int settling_periods = 0;      ///< rest at a stop: what the filters behind hold
  /// Filters behind, and how far these may take the set-points from their path.
  std::vector<FilterStages> chains;
  double filtered_mm = no_limit;
};

/// Plans the motion over a ring of segments. A section that does not keep the limits at every set-point is never given
/// out: it is planned once more with less, and until that succeeds the stop behind the last one stands.
class OnlinePlanner {
 public:
  OnlinePlanner(SegmentRing& ring, const PlanningRules& rules);

  /// At rest at the start of segment `first`, the next one that will be pushed.
  void restart(std::uint64_t first, const AxisValues& position) noexcept;

  /// Plans until enough periods lie ahead. `pushed`: segments that are known; `ratios`: of the feeds, above 0;
  /// `settled`: the filters behind have come to rest; `stops_over`: stops of the queue that are over. Does
  /// not allocate. False: there was nothing to do.
  bool plan(std::uint64_t pushed, const FeedRatios& ratios, bool settled, std::uint64_t stops_over);

  [[nodiscard]] Sections& sections() noexcept { return sections_; }
  [[nodiscard]] const Sections& sections() const noexcept { return sections_; }
  /// The segment that is being run; of those before it as many are needed as RoundedPath looks back.
  [[nodiscard]] std::uint64_t running() const noexcept { return running_.load(std::memory_order_acquire); }
  /// No motion within the limits was found behind the last section: its stop is run, although plans are in time.
  [[nodiscard]] bool has_failed() const noexcept { return has_failed_.load(std::memory_order_relaxed); }

 private:
  void follow_reader() noexcept;
  [[nodiscard]] std::ptrdiff_t periods_ahead() const noexcept;
  [[nodiscard]] int rest_at(const PathPoint& point) const noexcept;
  [[nodiscard]] bool waits_at(const PathPoint& point) const noexcept;
  [[nodiscard]] bool is_tight() const noexcept;
  [[nodiscard]] bool is_short() const noexcept;
  [[nodiscard]] double stop_mm(double speed, double acceleration, double jerk) const noexcept;
  [[nodiscard]] bool wants_plan(const PathPoint& from, std::uint64_t pushed) const noexcept;
  std::uint64_t look_ahead(const PathPoint& from, std::uint64_t pushed, const FeedRatios& ratios) noexcept;
  std::optional<PathPoint> next_start(std::uint64_t pushed) noexcept;
  void join(Section& section) const noexcept;
  void begin_with_less(std::uint64_t segment) noexcept;
  void rest_first(const PathPoint& from) noexcept;
  bool next_section(Section& section, std::uint64_t pushed, const FeedRatios& ratios);
  void bind_to_spindle(Section& section, const PathPoint& from, std::uint64_t pushed) noexcept;
  [[nodiscard]] bool begins_bound(const PathPoint& point) const noexcept;
  PathMotion begin_plan(Section& section, const PathPoint& from, const PathStart& start, std::uint64_t pushed,
                        bool checks);
  bool keeps_ahead(Section& section, PathMotion motion, std::uint64_t pushed, bool reduces) noexcept;
  bool fill(Section& section, double max_speed, double stop_share, int& settle) noexcept;
  void add(Section& section, std::size_t index, const PathMotion& motion) const noexcept;
  bool keeps(const Section& section, bool reduces) noexcept;
  void publish(Section& section) noexcept;
  void give_out(Section& section, const PathPoint& from, std::uint64_t pushed) noexcept;

  SegmentRing* ring_;
  PlanningRules rules_;
  ContourCheck contour_;
  Sections sections_;
  PathPlan plan_;
  PathMotion motion_;                      // on the plan, at the end of the last section
  bool has_motion_ = false;                // whether that is where the next one goes on
  FeedRatios ratios_;                      // of the plan
  std::uint64_t first_ = 0, planned_ = 0;  // segments: the begin of the path, and the end of what is planned
  std::uint64_t pushed_before_ = 0;        // when a section was planned last
  std::uint64_t fixed_ = 0;                // the last one whose rounding at its start is fixed
  int settle_ = 0;                         // periods of rest that are left at a stop
  const Section* last_ = nullptr;
  std::uint32_t last_number_ = 0;
  std::uint64_t published_ = 0;  // sections since the restart
  std::size_t start_ = 0;        // behind how many of its points the next one goes on
  std::size_t length_ = 1;       // periods of the next one
  bool settled_ = true;          // the filters behind
  std::uint64_t stops_over_ = 0;
  std::uint32_t failed_ = 0;  // the section behind which no motion was found, plus 1
  std::size_t retry_ = 0;
  double least_acceleration_ = 0.0, least_jerk_ = 0.0;
  bool is_full_ = false;          // the plan reaches as far as the window
  bool is_tight_ = false;         // and that is hardly further than the longest stop
  double ahead_mm_ = 0.0;         // how far that is
  double longest_stop_mm_ = 0.0;  // of the segments that are planned
  alignas(cache_line) std::atomic<std::uint64_t> running_{0};
  std::atomic<bool> has_failed_{false};
};

}  // namespace shapegcode
