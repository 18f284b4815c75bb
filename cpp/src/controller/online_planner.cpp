#include "controller/online_planner.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "planner/planned_limits.hpp"

namespace shapegcode {
namespace {

// Number of periods of a section by the length of the stop after it, over which the cost of planning that stop is
// distributed.
constexpr double periods_share = 0.125;
constexpr std::size_t shortest_section = 8;
constexpr std::size_t longest_section = 32;
// The lead is made of so many sections; besides there is the one that is run, and one that is planned.
constexpr std::size_t sections_ahead = 8;
constexpr std::size_t spare_sections = 3;
// A running motion is planned on from so many periods ahead where another thread steps.
constexpr std::size_t margin_periods = 2;
// So many of the longest stops are planned ahead, and another plan is made when so many are left.
constexpr double stops_planned = 8.0;
constexpr double stops_ahead = 2.0;
// Where they do not reach so far: stations that are planned for each segment that is new, but no larger share of the
// window than that, or of the stations where these are too few for the window.
constexpr double stations_for_new = 16.0;
constexpr double renewed_share = 0.25;
// In a window that holds the braking distance but no long section besides, sections are shorter and plans are made more
// often: what a section takes of the window, the motion has less to brake in. Only where plans are small: so many
// stations for each period of a section, which take some tenths of it.
constexpr std::size_t section_if_tight = 6;
constexpr double stations_for_new_if_tight = 64.0;
constexpr std::size_t stations_of_period = 32;
// A window is short if what a stop from the mean speed takes is a larger share of it.
constexpr double short_share = 0.4;
// What is tried while the motion is under way: a share of its speed, of the limits for the section, and of those for
// the stop behind it, which no plan has checked; and how often from rest, with less each time. Less acceleration is
// tried before the motion slows down: it would crawl where it may go on, but may not accelerate as fast as it was
// planned.
struct Trial {
  double speed, share, stop_share;
};
constexpr std::array<Trial, 10> trials{{{no_limit, 1.0, 1.0},
                                        {no_limit, 1.0, 0.99},
                                        {no_limit, 1.0, 0.9},
                                        {no_limit, 1.0, 0.7},
                                        {no_limit, 1.0, 0.4},
                                        {no_limit, 0.3, 0.3},
                                        {no_limit, 0.1, 0.1},
                                        {0.9, 1.0, 1.0},
                                        {0.6, 1.0, 1.0},
                                        {0.0, 1.0, 1.0}}};
constexpr int attempts_at_rest = 12;
// Plans that are made at once, with less each time where limits would be passed.
constexpr int plans = 4;
constexpr double least_ratio = 0.01;
// A lower override is approached from above.
constexpr double below_feed = 0.9995;
// Stations for each segment of the window, and at least.
constexpr std::size_t stations_of_segment = 16;
constexpr std::size_t least_stations = 2048;
// Points of a section: those of the longest stop, twice, within these bounds; and the speed where none is limited.
constexpr double stop_room = 2.0;
constexpr double least_points = 512.0;
constexpr double most_points = 16384.0;
constexpr double highest_speed = 1000.0;

bool is_as_far(const PathPoint& one, const PathPoint& other) noexcept {
  return std::pair(one.segment, one.offset) >= std::pair(other.segment, other.offset);
}

Vector3 xyz(const PlannedPoint& point) noexcept { return {point.position[0], point.position[1], point.position[2]}; }

std::size_t points_of(const PlanningRules& rules) noexcept {
  double longest_s = 0.0;
  for (std::size_t i = 0; i < rules.limits.axes; ++i) {
    const double speed = std::min(rules.limits.speed[i], highest_speed);
    const double acceleration = rules.limits.acceleration[i];
    longest_s = std::max(longest_s, speed / acceleration + acceleration / rules.limits.jerk[i]);
  }
  const double points = stop_room * longest_s / rules.period_s;
  return std::max(longest_section, static_cast<std::size_t>(rules.lead_periods) / sections_ahead) +
         static_cast<std::size_t>(std::clamp(points, least_points, most_points));
}

}  // namespace

OnlinePlanner::OnlinePlanner(SegmentRing& ring, const PlanningRules& rules)
    : ring_(&ring),
      rules_(rules),
      contour_(rules.chains, rules.filtered_mm, points_of(rules)),
      sections_(points_of(rules), rules.lead_periods > 0 ? sections_ahead + spare_sections : spare_sections + 1,
                contour_.duration()),
      plan_(ring, planned_limits(rules.limits, rules.period_s), rules.period_s,
            rules.is_open ? 0 : std::max(least_stations, stations_of_segment * rules.window), rules.max_across),
      motion_(plan_, rules.period_s) {
  const auto end = static_cast<std::ptrdiff_t>(rules.limits.axes);
  const AxisLimits limits = planned_limits(rules.limits, rules.period_s);
  least_acceleration_ = *std::min_element(limits.acceleration.begin(), limits.acceleration.begin() + end);
  least_jerk_ = *std::min_element(limits.jerk.begin(), limits.jerk.begin() + end);
  restart(0, {});
}

void OnlinePlanner::restart(std::uint64_t first, const AxisValues& position) noexcept {
  PlannedPoint point;
  point.position = position;
  point.point.segment = first;
  sections_.restart(point);
  plan_.forget();
  last_ = &sections_.current();
  last_number_ = 0;
  published_ = 0;
  start_ = 0;
  length_ = shortest_section;
  has_motion_ = false;
  settle_ = 0;
  failed_ = 0;
  has_failed_.store(false, std::memory_order_relaxed);
  first_ = planned_ = fixed_ = pushed_before_ = first;
  ratios_ = {};
  running_.store(first, std::memory_order_release);
}

// Where the next section has to go on: behind the last one, or on the stop of one whose successors came too late.
void OnlinePlanner::follow_reader() noexcept {
  const Sections::Reader reader = sections_.reader();
  const Section& current = sections_.section_of(reader);
  const bool rests = reader.index == current.whole_count;
  running_.store(rests ? current.done : current.before[0].point.segment, std::memory_order_release);
  const std::uint32_t last = sections_.last_behind(reader);
  if (last != last_number_) {
    last_ = last == reader.section ? &current : &sections_.section(last);
    last_number_ = last;
    start_ = last_->count;
    has_motion_ = false;
  }
  if (last != reader.section) return;
  const std::size_t margin = rules_.lead_periods > 0 ? margin_periods : 0;
  const std::size_t start = std::min(std::max(last_->count, reader.index + margin), last_->whole_count);
  if (start != last_->count) has_motion_ = false;
  start_ = start;
}

std::ptrdiff_t OnlinePlanner::periods_ahead() const noexcept {
  const Sections::Reader reader = sections_.reader();
  const Section& current = sections_.section_of(reader);
  return static_cast<std::ptrdiff_t>(last_->first_period + start_) -
         static_cast<std::ptrdiff_t>(current.first_period + reader.index);
}

bool OnlinePlanner::plan(std::uint64_t pushed, const FeedRatios& ratios, bool settled, std::uint64_t stops_over) {
  bool has_worked = false;
  settled_ = settled;
  stops_over_ = stops_over;
  while (true) {
    follow_reader();
    if (periods_ahead() > rules_.lead_periods) return has_worked;
    // On a stop from which no motion was found, it is looked for once in a while.
    if (failed_ == last_number_ + 1 && start_ < retry_ && start_ < last_->whole_count) return has_worked;
    Section* const section = sections_.free_section();
    if (section == nullptr || !next_section(*section, pushed, ratios)) return has_worked;
    has_worked = true;
  }
}

// Periods of rest at a stop.
int OnlinePlanner::rest_at(const PathPoint& point) const noexcept {
  const PlannedSegment& here = (*ring_)[point.segment];
  return rules_.settling_periods + (point.offset <= 0.0 ? static_cast<int>(here.dwell) : 0);
}

bool OnlinePlanner::begins_bound(const PathPoint& point) const noexcept {
  return point.offset <= 0.0 && (*ring_)[point.segment].rate_of == FeedRate::synchronous;
}

bool OnlinePlanner::waits_at(const PathPoint& point) const noexcept {
  return point.offset <= 0.0 && (*ring_)[point.segment].waits > stops_over_;
}

bool OnlinePlanner::is_tight() const noexcept {
  return is_tight_ && plan_.end() <= stations_of_period * shortest_section;
}

bool OnlinePlanner::wants_plan(const PathPoint& from, std::uint64_t pushed) const noexcept {
  const std::uint64_t end = std::min(pushed, from.segment + rules_.window);
  if (!plan_.is_cut() && planned_ >= end) return false;
  if (motion_.at_end()) return true;
  if (planned_ < end && (*ring_)[planned_].rate_of == FeedRate::synchronous) return plan_.is_cut();
  // Where no more can be planned than that, another plan has to be worth its work.
  if (plan_.is_cut()) {
    return static_cast<double>(motion_.passed()) >= renewed_share * static_cast<double>(plan_.end());
  }
  const bool has_more = end < pushed || pushed != pushed_before_;
  const double for_new = is_tight() ? stations_for_new_if_tight : stations_for_new;
  const double worth =
      std::min(static_cast<double>(plan_.end()) / for_new, renewed_share * static_cast<double>(rules_.window));
  if (is_full_ && has_more && static_cast<double>(end - planned_) < worth) return false;
  // Before the motion has to brake for what is only the end of the plan.
  return motion_.is_near_end(stops_ahead * longest_stop_mm_);
}

// What a stop takes, and what may be run before it begins.
double OnlinePlanner::stop_mm(double speed, double acceleration, double jerk) const noexcept {
  const double sections_s = rules_.period_s * static_cast<double>(longest_section + margin_periods);
  return speed * (0.5 * stopping_time(speed, acceleration, jerk) + sections_s);
}

// Whether it is the window that makes the motion slow.
bool OnlinePlanner::is_short() const noexcept {
  const double speed = ahead_mm_ / plan_.expected_s();
  return is_full_ && stop_mm(speed, least_acceleration_, least_jerk_) > short_share * ahead_mm_;
}

// How far is planned: as many of the longest stops ahead as make it worth while, and the segments that this takes.
std::uint64_t OnlinePlanner::look_ahead(const PathPoint& from, std::uint64_t pushed,
                                        const FeedRatios& ratios) noexcept {
  const std::uint64_t last = std::max(std::min(pushed, from.segment + rules_.window), fixed_ + 1);
  longest_stop_mm_ = 0.0;
  double longest_braking_mm = 0.0;
  double ahead = -from.offset;
  std::uint64_t end = from.segment;
  // Not without a rounding that the motion has entered.
  while (end < last && (end <= std::max(fixed_, from.segment) || ahead < stops_planned * longest_stop_mm_)) {
    // What is bound to the spindle is not planned.
    if (end > from.segment && (*ring_)[end].rate_of == FeedRate::synchronous) break;
    const PlannedSegment& entry = (*ring_)[end++];
    const double v = std::max(from.state.speed, std::min(entry.max_speed, entry.programmed * ratios.of(entry)));
    double a = least_acceleration_;
    double jerk = least_jerk_;
    if (std::isfinite(entry.max_acceleration)) a = std::min(a, entry.max_acceleration);
    if (std::isfinite(entry.max_jerk)) jerk = std::min(jerk, entry.max_jerk);
    longest_stop_mm_ = std::max(longest_stop_mm_, stop_mm(v, a, jerk));
    longest_braking_mm = std::max(longest_braking_mm, 0.5 * v * braking_time(v, a, jerk));
    ahead += entry.segment.length_mm;
  }
  is_full_ = end == from.segment + rules_.window;
  is_tight_ = is_full_ && ahead >= longest_braking_mm && ahead < longest_stop_mm_;
  ahead_mm_ = ahead;
  return end;
}

// The place from which the next section starts, if there is a way to go from it.
std::optional<PathPoint> OnlinePlanner::next_start(std::uint64_t pushed) noexcept {
  PathPoint from = last_->at(static_cast<std::ptrdiff_t>(start_)).point;
  const bool rests = from.state.speed <= 0.0;
  if (from.segment >= pushed) return std::nullopt;
  if (from.offset >= (*ring_)[from.segment].segment.length_mm - no_travel_mm) {
    if (from.segment + 1 >= pushed) return std::nullopt;
    from.offset = std::max(0.0, from.offset - (*ring_)[from.segment].segment.length_mm);
    PlannedSegment& next = (*ring_)[++from.segment];
    // There was nothing behind it, or a stop.
    if (rests) {
      next.stop = true;
      from.offset = 0.0;
    }
  }
  if (rests && waits_at(from)) return std::nullopt;
  return from;
}

// Behind the last one.
void OnlinePlanner::join(Section& section) const noexcept {
  section.is_bound = false;
  section.after = last_number_;
  section.start = start_;
  section.first_period = last_->first_period + start_;
  // What was bound to the spindle has come to rest there long ago.
  const bool is_bound = last_->is_bound && start_ > 0;
  for (std::size_t i = 0; i < section.before.size(); ++i) {
    const std::size_t back = is_bound ? 0 : i;
    section.before[i] = last_->at(static_cast<std::ptrdiff_t>(start_) - static_cast<std::ptrdiff_t>(back));
  }
  // Nor do the filters hold anything of what came before a rest in which they have settled.
  const bool is_settled = settled_ && periods_ahead() <= 0 && section.before[0].point.state.speed <= 0.0;
  for (std::size_t i = 0; i < section.past.size(); ++i) {
    const std::size_t back = is_bound || is_settled ? 0 : i;
    section.past[i] = back < start_ ? xyz(last_->points[start_ - back - 1]) : last_->past[back - start_];
  }
}

// It is too fast to stop again within a section.
void OnlinePlanner::begin_with_less(std::uint64_t segment) noexcept {
  for (std::uint64_t i = segment; i < std::min(planned_, segment + 2); ++i) {
    PlannedSegment& less = (*ring_)[i];
    if (less.limit_share < least_share) continue;
    less.limit_share *= most_less;
    less.feed_share *= most_less;
  }
}

// Periods of rest that are left before the motion begins.
void OnlinePlanner::rest_first(const PathPoint& from) noexcept {
  const bool is_settled = settled_ && periods_ahead() <= 0;
  const bool is_stop = (*ring_)[from.segment].stop && from.offset <= 0.0;
  const int needed = is_stop ? rest_at(from) - (is_settled ? rules_.settling_periods : 0) : 0;
  const bool was_planned = has_motion_ && !motion_.at_end() && !motion_.has_strayed();
  settle_ = was_planned ? std::min(settle_, needed) : needed;
}

bool OnlinePlanner::next_section(Section& section, std::uint64_t pushed, const FeedRatios& asked) {
  const std::optional<PathPoint> start = next_start(pushed);
  if (!start) return false;
  const PathPoint& from = *start;
  const bool rests = from.state.speed <= 0.0;
  const PlannedSegment& here = (*ring_)[from.segment];
  // What is multiplied with 0 is not begun, and planned with little where it is still ahead.
  if (rests && asked.of(here) <= 0.0) return false;
  const FeedRatios ratios = larger(asked, {least_ratio, least_ratio, least_ratio});
  if (rests) rest_first(from);
  const double feed = here.programmed * here.feed_share * ratios.of(here);
  const bool is_faster = from.state.speed > std::min(here.max_speed, feed) * kept_feed;
  const FeedRatios planned_ratios = is_faster ? larger(ratios, ratios_) : ratios;
  bool makes_plan = !has_motion_ || motion_.has_strayed() || planned_ratios != ratios_ || wants_plan(from, pushed);
  pushed_before_ = pushed;
  join(section);
  if (rests && begins_bound(from)) {
    bind_to_spindle(section, from, pushed);
    return true;
  }
  const int attempts = rests ? attempts_at_rest : static_cast<int>(trials.size());
  PathMotion begin = motion_;
  // Under way on the stations of the plan before: a state that just keeps the limits there keeps them here.
  const bool goes_on =
      has_motion_ && !rests && !motion_.at_end() && plan_.station(motion_.passed()).segment == from.segment;
  const PathStart path_start{first_, from.segment, from.offset, goes_on ? motion_.in_station() : 0.0, published_ + 1};
  for (int n = 0; n < attempts; ++n) {
    if (makes_plan) {
      fixed_ = plan_.release(from.segment, std::max(planned_, fixed_ + 1), last_->serial);
      planned_ = look_ahead(from, pushed, planned_ratios);
      ratios_ = planned_ratios;
      has_motion_ = false;
      begin = begin_plan(section, from, path_start, pushed, !is_faster);
    }
    motion_ = begin;
    const Trial& trial = trials[rests ? 0 : static_cast<std::size_t>(n)];
    double max_speed = rests ? no_limit : trial.speed * from.state.speed;
    if (is_faster) max_speed = std::min(max_speed, below_feed * feed);
    motion_.limit_to(trial.share);
    int settle = settle_;
    const bool is_whole = fill(section, max_speed, trial.stop_share, settle);
    if (is_whole && section.count == 0) return false;
    if (is_whole && keeps(section, rests)) {
      settle_ = settle;
      give_out(section, from, pushed);
      return true;
    }
    makes_plan = rests;
    if (rests && !is_whole) begin_with_less(from.segment);
  }
  has_motion_ = false;
  failed_ = last_number_ + 1;
  has_failed_.store(true, std::memory_order_relaxed);
  retry_ = start_ + shortest_section;
  return false;
}

// The motion on a new plan.
PathMotion OnlinePlanner::begin_plan(Section& section, const PathPoint& from, const PathStart& start,
                                     std::uint64_t pushed, bool checks) {
  const auto make = [&] {
    plan_.make(start, from.state, planned_, ratios_);
    return PathMotion(plan_, rules_.period_s, from.state, start.in_station);
  };
  PathMotion begin = make();
  if (!checks) return begin;
  bool is_kept = keeps_ahead(section, begin, pushed, true);
  for (int n = 1; n < plans && !is_kept; ++n) {
    begin = make();
    // Not behind the last plan, which is followed: it would enter a rounding that has become a stop.
    is_kept = keeps_ahead(section, begin, pushed, n + 1 < plans);
  }
  // Where the window does not slow the motion down: braking through valleys, if it is as far after as many periods.
  if (!is_kept || is_short()) return begin;
  const std::size_t count = section.count;
  const PathPoint before = section.at(static_cast<std::ptrdiff_t>(count)).point;
  if (!plan_.choose_valleys()) return begin;
  const PathMotion other(plan_, rules_.period_s, from.state, start.in_station);
  if (keeps_ahead(section, other, pushed, false) && section.count <= count) {
    const PathPoint& now = section.at(static_cast<std::ptrdiff_t>(section.count)).point;
    if (section.count < count || is_as_far(now, before)) return other;
  }
  plan_.forget();
  return make();
}

// Whether a motion keeps the limits as far as the plan will be followed; where it does not, less is planned there.
bool OnlinePlanner::keeps_ahead(Section& section, PathMotion motion, std::uint64_t pushed, bool reduces) noexcept {
  const bool is_whole = planned_ == pushed && !plan_.is_cut();
  std::size_t n = 0;
  while (n < sections_.capacity() && !motion.at_end()) {
    if (!is_whole && n % shortest_section == 0 && n > 0 && motion.is_near_end(longest_stop_mm_)) break;
    motion.advance();
    add(section, n++, motion);
  }
  section.count = section.whole_count = n;
  return keeps(section, reduces);
}

// Runs the motion on, and to a stop; false: it does not begin, or that takes too long.
bool OnlinePlanner::fill(Section& section, double max_speed, double stop_share, int& settle) noexcept {
  section.count = section.whole_count = 0;
  std::size_t n = 0;
  while (n < length_ && !motion_.at_end()) {
    const bool rests = motion_.at_stop();
    if (n > 0 && rests && (waits_at(motion_.point()) || begins_bound(motion_.point()))) break;
    if (settle > 0 && rests) {
      --settle;
    } else {
      const bool rested = motion_.at_rest();
      motion_.advance(max_speed);
      if (rested && motion_.at_rest()) return false;
      if (motion_.at_stop()) settle = motion_.at_end() ? rules_.settling_periods : rest_at(motion_.point());
    }
    add(section, n++, motion_);
    if (motion_.has_strayed()) break;  // the next section begins there, with a plan of its own
  }
  section.count = n;
  PathMotion stop = motion_;
  stop.limit_to(stop_share);
  while (!stop.at_rest()) {
    if (n == sections_.capacity()) return false;
    stop.advance(0.0);
    add(section, n++, stop);
  }
  section.whole_count = n;
  return true;
}

void OnlinePlanner::add(Section& section, std::size_t index, const PathMotion& motion) const noexcept {
  const PlannedPoint& before = section.at(static_cast<std::ptrdiff_t>(index));
  PlannedPoint& now = section.points[index];
  now.point = motion.point();
  const PlannedSegment& entry = (*ring_)[now.point.segment];
  now.position = motion.position();
  motion.rates(now.velocity, now.acceleration);
  now.line = entry.segment.line;
  now.rate_of = entry.rate_of;
  const double length = entry.segment.length_mm;
  if (motion.at_end() && now.point.offset >= length - no_travel_mm) {
    // To the last bit, whatever distances round to.
    std::copy_n(entry.segment.end_mm.data(), axis_count, now.position.begin());
    for (std::size_t i = axis_count; i < plan_.axes(); ++i) now.position[i] = entry.end[i];
  }
  double travel = now.point.offset - before.point.offset;
  for (std::uint64_t i = before.point.segment; i < now.point.segment; ++i) travel += (*ring_)[i].segment.length_mm;
  now.distance = (before.point.state.speed > 0.0 ? before.distance : 0.0) + travel;
}

// Whether all set-points keep the limits; where they do not, and the motion begins at rest, less is planned there.
bool OnlinePlanner::keeps(const Section& section, bool reduces) noexcept {
  const double t = rules_.period_s;
  const auto last = static_cast<std::ptrdiff_t>(section.whole_count);
  bool keeps = true;
  const auto at = [&](std::ptrdiff_t k) -> const PlannedPoint& { return section.at(std::min(k, last)); };
  // A motion under way is in the middle of what it does at first.
  const PlannedPoint& begin = section.before[0];
  const bool is_moving = begin.point.state.speed > 0.0;
  const std::ptrdiff_t reduced_from = is_moving ? static_cast<std::ptrdiff_t>(shortest_section * length_) : 0;
  const auto held = static_cast<std::ptrdiff_t>(contour_.duration());
  const std::ptrdiff_t end = last + (at(last).point.state.speed > 0.0 ? 0 : std::max<std::ptrdiff_t>(3, held));
  contour_.begin(section.past);
  std::uint64_t reduced = 0;  // segments before this one have been reduced already
  for (std::ptrdiff_t k = 1; k <= end; ++k) {
    double beyond = 0.0;
    const PlannedPoint& now = at(k);
    const PlannedPoint& before = at(k - 1);
    for (std::size_t i = 0; i < rules_.limits.axes; ++i) {
      const double p0 = now.position[i];
      const double p1 = before.position[i];
      const double p2 = at(k - 2).position[i];
      const double p3 = at(k - 3).position[i];
      // A coordinate is rounded: what its last bits do to a difference is no motion.
      const double noise = 8.0 * std::abs(p0) * std::numeric_limits<double>::epsilon() / (t * t * t);
      beyond = std::max({beyond, std::abs(p0 - p1) / (t * rules_.limits.speed[i]),
                         std::abs(p0 - 2.0 * p1 + p2) / (t * t * rules_.limits.acceleration[i]),
                         (std::abs(p0 - 3.0 * p1 + 3.0 * p2 - p3) / (t * t * t) - noise) / rules_.limits.jerk[i]});
    }
    // What leaves the path behind the filters does so by the acceleration that these hold.
    const double off_path = contour_.is_on() ? contour_.add(xyz(now)) : 0.0;
    const PlannedSegment& entry = (*ring_)[now.point.segment];
    const PlannedSegment& last_entry = (*ring_)[before.point.segment];
    const double feed = std::max(ratios_.of(entry) * entry.programmed, ratios_.of(last_entry) * last_entry.programmed);
    const double speed = now.point.state.speed;
    const bool is_faster = speed > before.point.state.speed && speed > kept_feed * feed;
    const bool is_beyond = beyond > kept || is_faster;
    if (!is_beyond && off_path <= kept) continue;
    if (!reduces) return false;
    keeps = false;
    if (k <= reduced_from) continue;
    const std::uint64_t first = at(std::max<std::ptrdiff_t>(k - (is_beyond ? 4 : held), 0)).point.segment;
    const std::uint64_t from = is_beyond ? first - std::min<std::uint64_t>(first, 1) : first;
    const std::uint64_t behind = std::min(planned_, is_beyond ? at(k + 1).point.segment + 2 : now.point.segment + 1);
    const std::uint64_t least = is_moving ? begin.point.segment + 1 : first_;
    const std::uint64_t begin_reduced = std::max({least, reduced, from});
    reduced = std::max(reduced, behind);
    for (std::uint64_t i = begin_reduced; i < behind; ++i) {
      PlannedSegment& less = (*ring_)[i];
      if (is_faster) less.feed_share *= feed / speed;
      const double most = std::max(beyond, off_path);
      // Still less does not help: what is beyond them has its cause in what is fixed. From rest nothing is.
      if (most > kept && less.limit_share > (is_moving ? least_share : useful_share)) {
        less.limit_share *= std::clamp(1.0 / most, most_less, off_path > kept ? least_less : 1.0);
      }
      // What is still beyond them when little is planned is run from rest to rest.
      if (less.limit_share < least_share && !less.is_fixed && !plan_.is_covered(i)) less.stop = true;
    }
    if (!contour_.is_on()) k += 4;
  }
  return keeps;
}

void OnlinePlanner::give_out(Section& section, const PathPoint& from, std::uint64_t pushed) noexcept {
  const PlannedPoint& rest = section.at(static_cast<std::ptrdiff_t>(section.whole_count));
  const PlannedSegment& entry = (*ring_)[rest.point.segment];
  const bool at_end = rest.point.offset >= entry.segment.length_mm - no_travel_mm;
  section.done = rest.point.segment + (at_end ? 1 : 0);
  section.runs_out = motion_.at_end() && at_end && section.done == pushed && !entry.segment.stop_at_end;
  fixed_ = std::max(fixed_, plan_.fix(from.segment, rest.point.segment, rest.point.offset, published_ + 1));
  const double periods = periods_share * static_cast<double>(section.whole_count - section.count);
  const std::size_t shortest = std::max(is_tight() ? section_if_tight : shortest_section,
                                        static_cast<std::size_t>(rules_.lead_periods) / sections_ahead);
  const std::size_t longest = is_tight() ? shortest : std::max(shortest, longest_section);
  length_ = std::clamp(static_cast<std::size_t>(periods), shortest, longest);
  has_motion_ = true;
  publish(section);
}

// A segment whose motion is not planned: the thread that steps runs it, from rest to rest.
void OnlinePlanner::bind_to_spindle(Section& section, const PathPoint& from, std::uint64_t pushed) noexcept {
  const PlannedSegment& entry = (*ring_)[from.segment];
  PlannedPoint& end = section.points[0];
  end = {};
  end.point = {from.segment, entry.segment.length_mm, {}};
  end.position = entry.end;
  std::copy_n(entry.segment.end_mm.data(), axis_count, end.position.begin());
  end.distance = entry.segment.length_mm;
  end.line = entry.segment.line;
  end.rate_of = entry.rate_of;
  section.is_bound = true;
  section.count = section.whole_count = 1;
  section.done = from.segment + 1;
  section.runs_out = section.done == pushed && !entry.segment.stop_at_end;
  fixed_ = std::max(fixed_, from.segment);
  has_motion_ = false;
  publish(section);
}

void OnlinePlanner::publish(Section& section) noexcept {
  section.low = section.high = section.before[0].position;
  for (std::size_t k = 0; k < section.whole_count; ++k) {
    for (std::size_t i = 0; i < rules_.limits.axes; ++i) {
      section.low[i] = std::min(section.low[i], section.points[k].position[i]);
      section.high[i] = std::max(section.high[i], section.points[k].position[i]);
    }
  }
  last_ = &section;
  last_number_ = sections_.next_number();
  start_ = section.count;
  section.serial = ++published_;
  has_failed_.store(false, std::memory_order_relaxed);
  sections_.publish();
}

}  // namespace shapegcode
