#include "shapegcode/command.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "command/feed_search.hpp"
#include "command/run_shaper.hpp"
#include "shapegcode/motion.hpp"

namespace shapegcode {
namespace {

std::shared_ptr<const Path> sub_path(const std::shared_ptr<const Path>& path, std::size_t first, std::size_t last) {
  if (first == 0 && last == path->size()) {
    return path;
  }
  return std::make_shared<const Path>(path->segments().part(first, last - first));
}

SpeedCaps part_of(const SpeedCaps& caps, std::size_t first, std::size_t last) {
  const auto cut = [&](const std::vector<float>& all) {
    return std::vector<float>(all.begin() + static_cast<std::ptrdiff_t>(first),
                              all.begin() + static_cast<std::ptrdiff_t>(last));
  };
  return {cut(caps.on_segment), cut(caps.at_junction)};
}

void put_part(const SpeedCaps& part, std::size_t first, SpeedCaps& caps) {
  std::ranges::copy(part.on_segment, caps.on_segment.begin() + static_cast<std::ptrdiff_t>(first));
  std::ranges::copy(part.at_junction, caps.at_junction.begin() + static_cast<std::ptrdiff_t>(first));
}

// Number of rows of a part; a part without periods has one row, its position at rest.
void put(const std::vector<Vector3>& grid, const std::vector<Vector3>& middle, const Vector3& at, ShapedCommand& part) {
  part.grid_mm.resize(static_cast<Eigen::Index>(std::max<std::size_t>(grid.size(), 1)), axis_count);
  part.middle_mm.resize(static_cast<Eigen::Index>(middle.size()), axis_count);
  part.grid_mm.row(0) = at;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    part.grid_mm.row(static_cast<Eigen::Index>(i)) = grid[i];
  }
  for (std::size_t i = 0; i < middle.size(); ++i) {
    part.middle_mm.row(static_cast<Eigen::Index>(i)) = middle[i];
  }
}

// A planned run given out row by row: as it was kept when it was planned, or shaped again, or while it is measured.
class ShapedRun {
 public:
  // The first round of a search, which stays the caller's.
  explicit ShapedRun(FeedSearch& search) : search_(&search) {
    search.begin_round();
    plan_ = search.plan();
  }
  // `filter` stays the caller's.
  ShapedRun(PlannedRun plan, const RunFilter& filter, const RunLimits& limits) : plan_(std::move(plan)) {
    if (plan_.rows.positions.size() == 0) {
      own_ = std::make_unique<RunShaper>(plan_.path, plan_.motion, filter, limits);
    }
  }

  [[nodiscard]] const PlannedRun& plan() const noexcept { return plan_; }

  [[nodiscard]] std::uint32_t periods() const noexcept {
    if (RunShaper* shaper = shaper_now()) return shaper->periods();
    return static_cast<std::uint32_t>(plan_.rows.arc_normals.size());
  }

  // False if the search says of its round that it is not the run looked for.
  bool next(Vector3& position) {
    if (search_ != nullptr) return search_->next(position);
    if (own_) {
      own_->next(position);
    } else {
      position = plan_.rows.positions[row_];
      plan_.rows.positions.forget_before(row_++);  // each is asked for once
    }
    return true;
  }

  // Of the period that begins at the row last given.
  [[nodiscard]] std::int8_t arc_normal() {
    if (RunShaper* shaper = shaper_now()) return shaper->arc_normal();
    return plan_.rows.arc_normals[(row_ - 1) / 2];
  }

 private:
  [[nodiscard]] RunShaper* shaper_now() const noexcept { return search_ != nullptr ? &search_->shaper() : own_.get(); }

  PlannedRun plan_;
  std::unique_ptr<RunShaper> own_;
  FeedSearch* search_ = nullptr;
  std::size_t row_ = 0;  // rows given out of those kept
};

}  // namespace

struct RegionShaper::State {
  State(std::shared_ptr<const Path> path, const Fir& shaper, std::span<const std::uint32_t> marked_segments,
        ShapingOptions options);

  [[nodiscard]] bool next(ShapedCommand& part, std::uint32_t periods);
  [[nodiscard]] bool begin_run();
  [[nodiscard]] std::unique_ptr<FeedSearch> search_of(const std::shared_ptr<const Path>& part) const;
  [[nodiscard]] PlannedRun plan_run();
  [[nodiscard]] PlannedTolerance plan_only(SpeedCaps& caps);
  void restart();
  void note_marks(const PlannedRun& run);
  [[nodiscard]] double share() const noexcept;

  struct SegmentRange {
    std::size_t first, last;  // segments
  };

  std::shared_ptr<const Path> path_;
  ShapingOptions options_;
  RunFilter filter_;
  std::unique_ptr<const RunPlanner> planner_;
  std::vector<std::uint32_t> marks_;
  std::vector<SegmentRange> ranges_;  // still to be run, the next one last
  std::uint32_t rest_periods_ = 0;

  SegmentRange now_{0, 0};
  std::unique_ptr<FeedSearch> search_;  // of a run that is given out early, or was; refers to the filter above
  std::unique_ptr<ShapedRun> run_;      // likewise
  SpeedCaps* start_caps_ = nullptr;     // of a plan without rows: where the search starts and what it comes to
  bool early_ = false;
  bool withdrawn_ = false;
  std::uint32_t given_ = 0;       // periods of the run given out
  std::uint32_t resting_ = 0;     // periods of rest still to come
  std::uint32_t period_ = 0;      // of the region
  Vector3 at_ = Vector3::Zero();  // last grid row
  std::vector<std::uint32_t> segment_periods_;
  double largest_deviation_mm_ = 0.0;
  std::uint32_t stops_ = 0;
  bool is_slowed_ = false;
};

RegionShaper::State::State(std::shared_ptr<const Path> path, const Fir& shaper,
                           std::span<const std::uint32_t> marked_segments, ShapingOptions options)
    : path_(std::move(path)),
      options_(std::move(options)),
      filter_(options_.axis_shapers.empty() ? std::span<const Fir>(&shaper, 1) : options_.axis_shapers, options_.target,
              options_.modes, options_.block_period_s, options_.contour_smoothness,
              {options_.following, options_.mode_tables}),
      marks_(marked_segments.begin(), marked_segments.end()) {
  filter_.feed_excess_ratio = options_.feed_excess_ratio;
  // A shaper delays by half its length, or so: what it mixes lies that far to both sides.
  const double last_tap_s = filter_.shaper_rows() * filter_.half_period_s;
  const double spread_s =
      std::max(filter_.mean_delay_s, last_tap_s - filter_.mean_delay_s) + 0.5 * options_.rest_at_stop_s;
  if (std::isfinite(options_.feed_excess_ratio)) {
    options_.limits.feed_excess_ratio = options_.feed_excess_ratio;
    options_.limits.feed_spread_s = spread_s;
  }
  planner_ = std::make_unique<const RunPlanner>(options_, spread_s);
  rest_periods_ = static_cast<std::uint32_t>(std::ceil(options_.rest_at_stop_s / options_.block_period_s - 1e-9));
  std::vector<std::size_t> borders =
      forced_stops(path_->segments(), options_.plunge_axis_angle_rad, options_.plunge_corner_angle_rad,
                   planner_->rules(), planner_->left_to_filter());
  const std::size_t forced = borders.size();
  for (const std::uint32_t segment : options_.further_stops) {
    if (segment > 0 && segment < path_->size()) borders.push_back(segment);
  }
  std::inplace_merge(borders.begin(), borders.begin() + static_cast<std::ptrdiff_t>(forced), borders.end());
  borders.erase(std::unique(borders.begin(), borders.end()), borders.end());
  borders.push_back(path_->size());
  std::size_t first = 0;
  for (const std::size_t border : borders) {
    ranges_.push_back({first, border});
    first = border;
  }
  std::ranges::reverse(ranges_);
}

// Plans the next run and starts it; false if there is none.
bool RegionShaper::State::begin_run() {
  if (ranges_.empty()) {
    return false;
  }
  if (early_) {
    now_ = ranges_.back();
    ranges_.pop_back();
    search_ = search_of(sub_path(path_, now_.first, now_.last));
    run_ = std::make_unique<ShapedRun>(*search_);
    given_ = 0;
    withdrawn_ = !run_->next(at_);
    note_marks(run_->plan());
    return true;
  }
  PlannedRun plan = plan_run();
  largest_deviation_mm_ = std::max(largest_deviation_mm_, plan.largest_deviation_mm);
  run_ = std::make_unique<ShapedRun>(std::move(plan), filter_, run_limits(options_.limits));
  given_ = 0;
  run_->next(at_);
  note_marks(run_->plan());
  return true;
}

std::unique_ptr<FeedSearch> RegionShaper::State::search_of(const std::shared_ptr<const Path>& part) const {
  return std::make_unique<FeedSearch>(part, run_limits(options_.limits), filter_, *planner_,
                                      options_.tolerance.contour_tolerance_mm, options_.least_feed_mm_per_s);
}

// The next run; where it must be split at corners, the rest stays among the ranges.
PlannedRun RegionShaper::State::plan_run() {
  for (;;) {
    now_ = ranges_.back();
    ranges_.pop_back();
    const auto part = sub_path(path_, now_.first, now_.last);
    if (options_.target == ContourTarget::none) {
      is_slowed_ = true;  // nobody asks by how much
      return {part, planner_->plan(part), 0.0, {}, {}};
    }
    const std::unique_ptr<FeedSearch> search = search_ ? std::move(search_) : search_of(part);
    if (start_caps_ != nullptr) {
      search->keep_no_rows();
      search->start_from(part_of(*start_caps_, now_.first, now_.last));
    }
    PlannedRun plan = search->run();
    is_slowed_ = is_slowed_ || search->is_slowed();
    if (plan.stops.empty()) {
      if (start_caps_ != nullptr) put_part(search->caps(), now_.first, *start_caps_);
      return plan;
    }
    stops_ += static_cast<std::uint32_t>(plan.stops.size());
    std::size_t last = now_.last;
    for (std::size_t i = plan.stops.size(); i-- > 0;) {
      ranges_.push_back({now_.first + plan.stops[i], last});
      last = now_.first + plan.stops[i];
    }
    ranges_.push_back({now_.first, last});
  }
}

// The time of the region without its rows. `caps`: where each search starts; then what it came to.
PlannedTolerance RegionShaper::State::plan_only(SpeedCaps& caps) {
  start_caps_ = &caps;
  std::size_t periods = 0;
  PlannedTolerance planned;
  while (!ranges_.empty()) {
    const PlannedRun plan = plan_run();
    planned.deviation_mm = std::max(planned.deviation_mm, plan.largest_deviation_mm);
    periods += RunShaper(plan.path, plan.motion, filter_, run_limits(options_.limits)).periods();
    if (!ranges_.empty()) periods += rest_periods_;
  }
  planned.duration_s = static_cast<double>(periods) * options_.block_period_s;
  return planned;
}

void RegionShaper::State::restart() {
  run_.reset();
  ranges_ = {{0, path_->size()}};
  early_ = withdrawn_ = is_slowed_ = false;
  given_ = resting_ = period_ = stops_ = 0;
  largest_deviation_mm_ = 0.0;
  segment_periods_.clear();
}

void RegionShaper::State::note_marks(const PlannedRun& run) {
  std::size_t cursor = 0;
  while (segment_periods_.size() < marks_.size() && marks_[segment_periods_.size()] < now_.last) {
    const std::size_t local = marks_[segment_periods_.size()] - now_.first;
    const double time = local == 0 ? 0.0 : run.motion->entered_s(local, cursor) + filter_.mean_delay_s;
    const auto period = static_cast<std::uint32_t>(std::lround(time / options_.block_period_s));
    segment_periods_.push_back(period_ + std::min(period, run_->periods()));
  }
}

double RegionShaper::State::share() const noexcept {
  double segments = static_cast<double>(now_.last);
  if (run_ && run_->periods() > 0) {
    segments -= static_cast<double>(now_.last - now_.first) * (1.0 - static_cast<double>(given_) / run_->periods());
  }
  return segments / std::max(1.0, static_cast<double>(path_->size()));
}

bool RegionShaper::State::next(ShapedCommand& part, std::uint32_t periods) {
  const std::uint32_t first = period_;
  std::vector<Vector3> grid;
  std::vector<Vector3> middle;
  std::vector<std::int8_t> normals;
  std::vector<std::uint32_t> run_ends;
  const auto add = [&](const Vector3& half, const Vector3& end, std::int8_t normal) {
    if (grid.empty()) {
      grid.push_back(at_);
    }
    middle.push_back(half);
    grid.push_back(end);
    normals.push_back(normal);
    at_ = end;
    ++period_;
  };
  while (period_ - first < periods) {
    if (resting_ > 0) {
      add(at_, at_, std::int8_t{-1});
      if (--resting_ == 0) {
        run_ends.push_back(period_ - first);
      }
      continue;
    }
    if (!run_ && !begin_run()) {
      break;
    }
    if (withdrawn_) {
      return false;
    }
    if (given_ < run_->periods()) {
      const std::int8_t normal = run_->arc_normal();
      Vector3 half;
      Vector3 end;
      withdrawn_ = !run_->next(half) || !run_->next(end);
      add(half, end, normal);
      ++given_;
    }
    if (given_ == run_->periods() && !withdrawn_) {
      if (early_) largest_deviation_mm_ = search_->largest_deviation_mm();
      run_.reset();
      resting_ = ranges_.empty() ? 0 : rest_periods_;
      if (resting_ == 0) {
        run_ends.push_back(period_ - first);
      }
    }
  }
  const bool over = !run_ && resting_ == 0 && ranges_.empty();
  if (over) {
    segment_periods_.resize(marks_.size(), period_);
  }
  if (grid.empty() && (first > 0 || !over)) {
    return false;
  }
  put(grid, middle, at_, part);
  part.first_period = first;
  part.arc_normal = std::move(normals);
  part.run_ends = std::move(run_ends);
  part.segment_periods = segment_periods_;
  return true;
}

RegionShaper::RegionShaper(std::shared_ptr<const Path> path, const Fir& shaper,
                           std::span<const std::uint32_t> marked_segments, ShapingOptions options)
    : state_(std::make_unique<State>(std::move(path), shaper, marked_segments, std::move(options))) {}

RegionShaper::RegionShaper(RegionShaper&&) noexcept = default;
RegionShaper& RegionShaper::operator=(RegionShaper&&) noexcept = default;
RegionShaper::~RegionShaper() = default;

bool RegionShaper::next(ShapedCommand& part, std::uint32_t periods) { return state_->next(part, periods); }

void RegionShaper::begin_early() noexcept {
  state_->early_ = state_->ranges_.size() == 1 && state_->options_.target != ContourTarget::none;
}

bool RegionShaper::is_withdrawn() const noexcept { return state_->withdrawn_; }

bool RegionShaper::restart() {
  if (!state_->early_) return false;
  state_->restart();
  return true;
}

double RegionShaper::largest_deviation_mm() const noexcept { return state_->largest_deviation_mm_; }

bool RegionShaper::is_slowed() const noexcept { return state_->is_slowed_; }

double RegionShaper::share() const noexcept { return state_->share(); }

std::uint32_t RegionShaper::stops() const noexcept { return state_->stops_; }

std::vector<PlannedTolerance> plan_tolerances(const std::shared_ptr<const Path>& path, const Fir& shaper,
                                              const ShapingOptions& options, std::span<const double> tolerances_mm) {
  constexpr float unlimited = std::numeric_limits<float>::infinity();
  SpeedCaps caps{std::vector<float>(path->size(), unlimited), std::vector<float>(path->size(), unlimited)};
  std::vector<PlannedTolerance> planned;
  planned.reserve(tolerances_mm.size());
  ShapingOptions each = options;
  for (const double tolerance_mm : tolerances_mm) {
    if (!planned.empty() && tolerance_mm <= each.tolerance.contour_tolerance_mm &&
        planned.back().deviation_mm <= tolerance_mm && options.target != ContourTarget::none) {
      planned.push_back(planned.back());  // what kept a larger one already
      continue;
    }
    each.tolerance.contour_tolerance_mm = tolerance_mm;
    planned.push_back(RegionShaper::State(path, shaper, {}, each).plan_only(caps));
  }
  return planned;
}

ShapedCommand shape_path(const std::shared_ptr<const Path>& path, const Fir& shaper,
                         std::span<const std::uint32_t> marked_segments, const ShapingOptions& options) {
  RegionShaper region(path, shaper, marked_segments, options);
  ShapedCommand command;
  static_cast<void>(region.next(command, std::numeric_limits<std::uint32_t>::max()));
  return command;
}

}  // namespace shapegcode
