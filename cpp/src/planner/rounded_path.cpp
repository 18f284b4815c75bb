#include "planner/rounded_path.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

// Widest rounding, mm.
constexpr double widest_mm = 3.0;
// Less is a stop: what could be passed at a crawl only.
constexpr double narrowest_mm = 2e-4;
// Intervals within a rounding: so many on its half-width. Closer breaks are passed over.
constexpr double intervals_on_half = 8.0;
constexpr double closest_on_half = 30000.0;
// An interval turns by no more on an arc.
constexpr double radians_of_arc = 0.1;
// Periods that an interval lasts at the programmed feed.
constexpr double periods_of_interval = 4.0;
// Towards a stop or a slower feed intervals shrink with the distance to it; of a stop down to what the jerk travels in
// so many periods.
constexpr double share_before_stop = 0.4;
constexpr double stopping_periods = 5.0;
constexpr double longest_stopping_mm = 0.5;
// Junctions that are looked at to each side.
constexpr std::size_t lookahead = RoundedPath::lookback - 2;
constexpr std::uint64_t everything = static_cast<std::uint64_t>(-1);
// The next feed is a slower one from this share of a feed down.
constexpr double slower_share = 0.999;
// Nothing is shorter, mm.
constexpr double shortest_mm = 1e-9;

// The curve that rounds a jump of 1 of the first derivative over |u| <= 1, u = x / d: its second derivative is the
// triangle of area 1. Times d.
struct Rounding {
  double position = 0.0, first = 0.0, second = 0.0, third = 0.0;
};

Rounding turn_rounding(double u, bool before) noexcept {
  const double left = 1.0 - std::abs(u);
  const double side = before ? 1.0 : -1.0;
  return {left * left * left / 6.0, side * 0.5 * left * left, left, side};
}

// The same of a jump of 1 of the second derivative, times d^2: odd, linear in pieces, without area and first moment
// against the jump, so that it is nothing beyond.
Rounding bend_rounding(double u, bool before) noexcept {
  const double side = before ? -1.0 : 1.0;
  const double w = std::abs(u);
  if (w >= 0.5) {
    const double left = 1.0 - w;
    return {side * left * left * left / 36.0, -left * left / 12.0, side * left / 6.0, -1.0 / 6.0};
  }
  return {side * w * (1.0 / 12.0 + w * (-0.25 + w * (7.0 / 36.0))), 1.0 / 12.0 + w * (-0.5 + w * (7.0 / 12.0)),
          side * (w * (7.0 / 6.0) - 0.5), 7.0 / 6.0};
}

// The half-width at which jumps of these shares take the whole tolerance: turn d + bend d^2 = 1.
double width_within(double turn, double bend) noexcept {
  const double half = 0.5 * turn;
  return 1.0 / (half + std::sqrt(half * half + bend));
}

}  // namespace

RoundedPath::RoundedPath(SegmentRing& ring, const AxisLimits& limits, double period_s)
    : ring_(&ring), limits_(limits), period_s_(period_s) {
  const auto end = static_cast<std::ptrdiff_t>(limits.axes);
  least_acceleration_ = *std::min_element(limits.acceleration.begin(), limits.acceleration.begin() + end);
  highest_acceleration_ = *std::max_element(limits.acceleration.begin(), limits.acceleration.begin() + end);
  const double jerk = *std::min_element(limits.jerk.begin(), limits.jerk.begin() + end);
  const double time_s = stopping_periods * period_s;
  stopping_length_ = std::min(longest_stopping_mm, jerk * time_s * time_s * time_s / 6.0);
}

void RoundedPath::start(const PathStart& start, std::uint64_t end, const FeedRatios& ratios) noexcept {
  start_ = start;
  end_ = end;
  ratios_ = ratios;
  segment_ = start.segment;
  PlannedSegment& at = (*ring_)[start.segment];
  if (starts_anew(start.segment)) at.distance = 0.0;
  start_x_ = at.distance + start.offset;
  x_ = start_x_ - start.in_station;
  for (std::uint64_t i = start.segment; i < end; ++i) {
    PlannedSegment& entry = (*ring_)[i];
    if (i == start.segment) fix(entry);
    if (entry.is_fixed) continue;
    entry.is_narrow = false;
  }
  for (std::uint64_t i = start.segment + 1; i < end; ++i) {
    (*ring_)[i].distance = starts_anew(i) ? 0.0 : end_of(i - 1);
  }
  bool same = true;  // no stop since the start
  for (std::uint64_t i = start.segment + 1; i < end; ++i) {
    if (!(*ring_)[i].is_fixed) choose(i);
    same = same && !starts_anew(i);
    if (!same) start_x_ = 0.0;
  }
}

bool RoundedPath::starts_anew(std::uint64_t segment) const noexcept {
  const PlannedSegment& entry = (*ring_)[segment];
  return segment == start_.first || entry.stop || entry.is_narrow;
}

double RoundedPath::end_of(std::uint64_t segment) const noexcept {
  const PlannedSegment& entry = (*ring_)[segment];
  return entry.distance + entry.segment.length_mm;
}

// As wide as a rounding may be whatever follows.
double RoundedPath::widest(std::uint64_t junction) const noexcept {
  const PlannedSegment& entry = (*ring_)[junction];
  double width = std::min(widest_mm, entry.distance - start_x_);
  std::uint64_t before = junction;
  for (std::size_t n = 0; n < lookahead && !starts_anew(before); ++n) {
    const PlannedSegment& earlier = (*ring_)[--before];
    // One that was chosen before this junction was known has not left it anything.
    if (earlier.is_fixed && junction >= earlier.saw_until && earlier.half_width > 0.0) {
      width = std::min(width, entry.distance - earlier.distance - earlier.half_width);
    }
  }
  if (!starts_anew(before)) width = std::min(width, 0.5 * (entry.distance - (*ring_)[before].distance));
  return std::min(width, width_within(entry.turn_share, entry.bend_share));
}

// The largest half-width d for which the junctions within 2 d, rounded as widely, stay within the tolerance together:
// whoever reaches a place is within 2 d of the widest that does.
void RoundedPath::choose(std::uint64_t junction) noexcept {
  PlannedSegment& entry = (*ring_)[junction];
  const double width_before = entry.half_width;
  const std::uint64_t saw_before = entry.saw_until;
  entry.half_width = 0.0;
  entry.passed = starts_anew(junction) ? 0.0 : no_limit;
  entry.saw_until = everything;
  if (starts_anew(junction) || (entry.turn_share <= 0.0 && entry.bend_share <= 0.0)) return;
  double width = widest(junction);
  double turn = entry.turn_share;
  double bend = entry.bend_share;
  std::uint64_t left = junction;
  std::uint64_t right = junction;
  while (true) {
    // The nearest junction that has not been counted.
    double to_left = no_limit;
    double to_right = no_limit;
    if (!starts_anew(left)) to_left = entry.distance - (*ring_)[left - 1].distance;
    const double end = end_of(right) - entry.distance;
    if (ends_in_stop(right)) {
      // Where more may follow, half of what is left is that of the junction there.
      const bool is_open = right + 1 == end_ && !(*ring_)[right].segment.stop_at_end;
      if (is_open && end < 2.0 * width) entry.saw_until = end_;
      width = std::min(width, is_open ? 0.5 * end : end);
    } else if (right - junction >= lookahead) {
      width = std::min(width, 0.5 * end);
    } else {
      to_right = end;
    }
    const double nearest = std::min(to_left, to_right);
    if (nearest >= 2.0 * width) break;
    const bool is_left = to_left <= to_right;
    const std::uint64_t next = is_left ? --left : ++right;
    if (starts_anew(next)) continue;  // at a stop nothing jumps that counts
    turn += (*ring_)[next].turn_share;
    bend += (*ring_)[next].bend_share;
    const double within = width_within(turn, bend);
    if (within < width) width = std::max(within, 0.5 * nearest);
    if (width <= 0.5 * nearest) break;
  }
  if (width < narrowest_mm) {
    if (!is_covered(junction)) return stop_at(junction);
    // The motion is in a rounding that goes on beyond this junction: no stop is possible there.
    width = std::max(width_before, narrowest_mm);
    entry.saw_until = saw_before;
    fix(entry);
  }
  entry.half_width = width;
  for (std::size_t i = 0; i < limits_.axes; ++i) {
    const double jump = std::abs(entry.turn[i]) / width + std::abs(entry.bend[i]);
    if (jump <= 0.0) continue;
    entry.passed =
        std::min({entry.passed, limits_.acceleration[i] / jump, std::pow(limits_.jerk[i] * width / jump, 2.0 / 3.0)});
  }
}

bool RoundedPath::is_covered(std::uint64_t junction) const noexcept {
  const double x = (*ring_)[junction].distance;
  std::uint64_t before = junction;
  for (std::size_t n = 0; n < lookahead && !starts_anew(before); ++n) {
    const PlannedSegment& earlier = (*ring_)[--before];
    if (earlier.is_fixed && earlier.distance + earlier.half_width > x) return true;
  }
  const std::uint64_t last = std::min(end_, junction + lookahead);
  for (std::uint64_t i = junction + 1; i < last && !starts_anew(i); ++i) {
    const PlannedSegment& later = (*ring_)[i];
    if (later.is_fixed && later.distance - later.half_width < x) return true;
  }
  return false;
}

// Distances count from there.
void RoundedPath::stop_at(std::uint64_t junction) noexcept {
  const double x = (*ring_)[junction].distance;
  (*ring_)[junction].is_narrow = true;
  (*ring_)[junction].passed = 0.0;
  double distance = 0.0;
  for (std::uint64_t i = junction; i < end_; ++i) {
    if (i > junction && starts_anew(i)) break;
    (*ring_)[i].distance = distance;
    distance += (*ring_)[i].segment.length_mm;
  }
  // What was chosen before this stop was known.
  std::uint64_t before = junction;
  for (std::size_t n = 0; n < lookahead && before > start_.first && !starts_anew(before - 1); ++n) {
    const PlannedSegment& earlier = (*ring_)[--before];
    if (before > start_.segment && !earlier.is_fixed && earlier.distance + earlier.half_width > x) choose(before);
  }
}

void RoundedPath::fix(PlannedSegment& entry) const noexcept {
  if (!entry.is_fixed) entry.fixed_by = start_.section;
  entry.is_fixed = true;
}

std::uint64_t RoundedPath::fix(std::uint64_t from, std::uint64_t segment, double offset,
                               std::uint64_t section) noexcept {
  start_.section = section;
  std::uint64_t fixed = segment;
  for (std::uint64_t i = from; i <= segment; ++i) fix((*ring_)[i]);
  const double x = (*ring_)[segment].distance + offset;
  const std::uint64_t last = std::min(end_, segment + lookback);
  for (std::uint64_t i = segment + 1; i < last && !starts_anew(i); ++i) {
    PlannedSegment& entry = (*ring_)[i];
    if (entry.half_width > 0.0 && entry.distance - entry.half_width < x) fix(entry);
    if (entry.is_fixed) fixed = i;
  }
  return fixed;
}

std::uint64_t RoundedPath::release(std::uint64_t first, std::uint64_t end, std::uint64_t last) noexcept {
  std::uint64_t fixed = first;
  for (std::uint64_t i = first; i < end; ++i) {
    PlannedSegment& entry = (*ring_)[i];
    entry.is_fixed = entry.is_fixed && entry.fixed_by <= last;
    if (entry.is_fixed) fixed = i;
  }
  return fixed;
}

bool RoundedPath::ends_in_stop(std::uint64_t segment) const noexcept {
  return segment + 1 == end_ || starts_anew(segment + 1);
}

double RoundedPath::feed_of(const PlannedSegment& entry) const noexcept {
  return std::min(entry.programmed * entry.feed_share * ratios_.of(entry), entry.max_speed);
}

// Of the last interval before a stop: what some periods of a constant jerk make of it, or less if the feed is slow.
double RoundedPath::stopping_length(const PlannedSegment& entry) const noexcept {
  return std::min(stopping_length_, feed_of(entry) * stopping_periods * period_s_ / 3.0);
}

// How far it is to the next stop, as far as that matters.
double RoundedPath::to_stop() const noexcept {
  for (std::uint64_t i = segment_; (*ring_)[i].distance <= x_ + 4.0 * widest_mm; ++i) {
    if (ends_in_stop(i)) return end_of(i) - x_;
  }
  return no_limit;
}

// Every junction whose rounding may begin within the segment at hand or reach it.
template <class See>
void RoundedPath::see_roundings(const See& see) const noexcept {
  const std::uint64_t last = std::min(end_, segment_ + lookahead + 2);
  for (std::uint64_t i = segment_ + 1; i < last && !starts_anew(i); ++i) {
    if ((*ring_)[i].distance - x_ > 4.0 * widest_mm) break;
    see((*ring_)[i], true);
  }
  std::uint64_t i = segment_;
  for (std::size_t n = 0; n <= lookahead && !starts_anew(i); ++n, --i) {
    if (x_ - (*ring_)[i].distance > widest_mm) break;
    see((*ring_)[i], false);
  }
}

// The next place where the third derivative jumps.
double RoundedPath::next_break() const noexcept {
  double at = end_of(segment_);
  double close = no_limit;
  see_roundings([&](const PlannedSegment& junction, bool) {
    if (std::abs(x_ - junction.distance) < junction.half_width) {
      close = std::min(close, junction.half_width / closest_on_half);
    }
  });
  const double least = x_ + (close < no_limit ? close : shortest_mm);
  see_roundings([&](const PlannedSegment& junction, bool) {
    const double d = junction.half_width;
    if (d <= 0.0) return;
    for (const double u : {-1.0, -0.5, 0.5, 1.0}) {
      if (std::abs(u) < 1.0 && junction.bend_share <= 0.0) continue;
      const double place = junction.distance + u * d;
      if (place > least && place < at) at = place;
    }
  });
  return at;
}

// The square of the speed that the junctions around let a motion have.
double RoundedPath::squared_speed() const noexcept {
  const double gain = 2.0 * least_acceleration_;
  double squared = gain * x_;
  see_roundings([&](const PlannedSegment& junction, bool) {
    squared = std::min(squared, junction.passed + gain * std::abs(x_ - junction.distance));
  });
  return squared;
}

namespace {

// In which all axes move, `offset` mm behind the start of a segment.
AxisValues direction_of(const PlannedSegment& entry, double offset) noexcept {
  AxisValues direction = entry.rate;
  const Vector3 tangent = tangent_at(entry.segment, offset);
  std::copy_n(tangent.data(), axis_count, direction.begin());
  return direction;
}

}  // namespace

// How long an interval may be here.
double RoundedPath::step() const noexcept {
  const PlannedSegment& entry = (*ring_)[segment_];
  const AxisValues direction = direction_of(entry, x_ - entry.distance);
  double speed = std::min(feed_of(entry), along(direction, limits_.speed, limits_.axes));
  double step = widest_mm;
  if (entry.segment.kind == SegmentKind::arc) {
    const double bend = curvature(entry.segment);
    speed = std::min(speed, std::sqrt(highest_acceleration_ / bend));
    step = std::min(step, radians_of_arc / bend);
  }
  speed = std::min(speed, std::sqrt(squared_speed()));
  step = std::min(step, std::max(periods_of_interval * period_s_ * speed, stopping_length(entry)));
  see_roundings([&](const PlannedSegment& junction, bool) {
    const double d = junction.half_width;
    if (d > 0.0 && x_ >= junction.distance - d - shortest_mm && x_ < junction.distance + d - shortest_mm) {
      step = std::min(step, d / intervals_on_half);
    }
  });
  return step;
}

// Whether a slower segment begins there.
bool RoundedPath::slows_at(std::uint64_t segment) const noexcept {
  return segment < end_ && feed_of((*ring_)[segment]) < slower_share * feed_of((*ring_)[segment - 1]);
}

// Whether a still slower one follows it so soon that braking goes on.
bool RoundedPath::slows_on(std::uint64_t segment) const noexcept {
  if (!slows_at(segment + 1)) return false;
  const PlannedSegment& entry = (*ring_)[segment];
  const double before = feed_of(entry);
  const double after = feed_of((*ring_)[segment + 1]);
  const AxisValues direction = direction_of(entry, 0.0);
  const double time_s = braking_time(before - after, along(direction, limits_.acceleration, limits_.axes),
                                     along(direction, limits_.jerk, limits_.axes));
  return entry.segment.length_mm < 0.5 * (before + after) * time_s;
}

bool RoundedPath::next(Station& station) noexcept {
  if (segment_ == end_) return false;
  double end = next_break();
  double length = step();
  if (slows_at(segment_ + 1)) {
    const double least = periods_of_interval * period_s_ * feed_of((*ring_)[segment_ + 1]);
    length = std::min(length, std::max(share_before_stop * (end_of(segment_) - x_), least));
  }
  const double left = to_stop();
  const double stopping_mm = stopping_length((*ring_)[segment_]);
  if (left > stopping_mm + shortest_mm) {
    length = std::min(length, std::max(share_before_stop * (left - stopping_mm), stopping_mm));
    end = std::min(end, x_ + left - stopping_mm);
  }
  const double room = end - x_;
  if (length < room) end = x_ + room / std::ceil(room / length);
  station = Station{};
  station.distance = x_;
  station.segment = segment_;
  station.offset = x_ - (*ring_)[segment_].distance;
  fill(end - x_, station);
  x_ = end;
  if (x_ >= end_of(segment_) - shortest_mm) {
    x_ = ends_in_stop(segment_) ? 0.0 : end_of(segment_);
    ++segment_;
  }
  return true;
}

Derivatives RoundedPath::roundings_at(double x, AxisValues& position) const noexcept {
  Derivatives sum;
  see_roundings([&](const PlannedSegment& junction, bool ahead) {
    const double d = junction.half_width;
    if (d <= 0.0) return;
    const double u = (x - junction.distance) / d;
    if (std::abs(u) >= 1.0) return;
    const Rounding turn = turn_rounding(u, ahead);
    const Rounding bend = bend_rounding(u, ahead);
    for (std::size_t i = 0; i < limits_.axes; ++i) {
      position[i] += d * (junction.turn[i] * turn.position + junction.bend[i] * d * bend.position);
      sum.first[i] += junction.turn[i] * turn.first + junction.bend[i] * d * bend.first;
      sum.second[i] += junction.turn[i] * turn.second / d + junction.bend[i] * bend.second;
      sum.third[i] += junction.turn[i] * turn.third / (d * d) + junction.bend[i] * bend.third / d;
    }
  });
  return sum;
}

void RoundedPath::fill(double length, Station& station) const noexcept {
  const PlannedSegment& entry = (*ring_)[segment_];
  station.length = length;
  station.arc = entry.segment.kind == SegmentKind::arc;
  station.speed_limit = feed_of(entry);
  see_roundings([&](const PlannedSegment& junction, bool) {
    const double from = std::abs(x_ + 0.5 * length - junction.distance) - 0.5 * length;
    if (from <= junction.half_width) station.speed_limit = std::min(station.speed_limit, junction.corner_speed);
  });
  station.share = entry.limit_share;
  station.stop = x_ <= 0.0;
  if (station.offset <= shortest_mm) {
    station.valley =
        entry.half_width > 0.0 && entry.passed < feed_of(entry) * feed_of(entry) && entry.passed <= squared_speed();
    station.slower_feed = !station.stop && segment_ > start_.segment && slows_at(segment_) && !slows_on(segment_);
    station.valley = station.valley || station.slower_feed;
  }
  AxisValues position{};
  const Derivatives begin = roundings_at(x_, position);
  AxisValues unused{};
  const Derivatives end = roundings_at(x_ + length, unused);
  bool rounded = false;
  for (std::size_t i = 0; i < limits_.axes; ++i) {
    station.position[i] = position[i];
    station.first[i] = begin.first[i];
    station.second[i] = begin.second[i];
    station.third[i] = (end.second[i] - begin.second[i]) / length;
    rounded = rounded || begin.second[i] != 0.0 || end.second[i] != 0.0;
  }
  if (!station.arc) {
    const Vector3 point = point_at(entry.segment, station.offset);
    const Vector3 tangent = tangent_at(entry.segment, 0.0);
    for (std::size_t i = 0; i < axis_count; ++i) {
      station.position[i] += point[static_cast<Eigen::Index>(i)];
      station.first[i] += tangent[static_cast<Eigen::Index>(i)];
    }
  }
  for (std::size_t i = axis_count; i < limits_.axes; ++i) {
    station.position[i] += entry.start[i] + entry.rate[i] * station.offset;
    station.first[i] += entry.rate[i];
  }
  station.max_acceleration = entry.max_acceleration;
  station.max_jerk = entry.max_jerk;
  station.straight = !station.arc && !rounded;
}

}  // namespace shapegcode
