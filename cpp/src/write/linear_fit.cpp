#include "write/linear_fit.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

namespace shapegcode {
namespace {

constexpr std::size_t longest_block = 64;  // blocks that one may take the place of
constexpr int most_misses = 4;             // ends in a row that do not fit, before a longer block is not looked for
constexpr std::size_t longest_start = 3;   // blocks of one that begins at rest
constexpr double max_sweep_rad = 80.0 * std::numbers::pi / 180.0;
constexpr double time_share = 0.25;    // of the tolerance: by how much a block may end too early or late
constexpr double speed_share = 4.0;    // of it: what the difference to the speed of the command may come to in a period
constexpr double line_share = 0.5;     // of it: what bends more is an arc
constexpr double least_arc_mm = 0.02;  // chord
constexpr double most_radius_mm = 9999.0;

/// A speed as its F is written: a tenth of mm/min, a hundredth below 100.
double written(double speed_mm_per_s) {
  const double feed = speed_mm_per_s * 60.0;
  const double digits = feed > 100.0 ? 10.0 : 100.0;
  return std::nearbyint(feed * digits) / digits / 60.0;
}

}  // namespace

CommandPoints::CommandPoints(const Path& path, double period_s) : points{path.start_mm(0)}, knots{0} {
  for (const Segment& segment : path.segments()) {
    const double periods = std::max(1.0, std::nearbyint(segment.length_mm / segment.feed_mm_per_s / period_s));
    for (double k = 1.0; k < periods; ++k) points.push_back(point_at(segment, segment.length_mm * k / periods));
    points.push_back(segment.end_mm);
    knots.push_back(points.size() - 1);
  }
}

LinearFit::LinearFit(const Path& path, double period_s, double tolerance_mm, std::span<const std::uint32_t> joints)
    : period_s_(period_s),
      tolerance_mm_(tolerance_mm),
      joints_(joints.begin(), joints.end()),
      command_(path, period_s),
      shapes_(longest_block + 1) {
  for (const Segment& segment : path.segments()) segments_.push_back(segment);
}

std::vector<LinearBlock> LinearFit::blocks() {
  std::vector<LinearBlock> found;
  double speed = 0.0;
  double late_s = 0.0;
  for (std::size_t at = 0; at < size();) {
    Found next = speed > 0.0 ? longest(at, speed, late_s) : Found{};
    const std::size_t taken = next ? next->block.last - at + 1 : 0;
    // One that begins with a feed of its own costs a line more.
    const Found fresh = begun(at, late_s);
    if (fresh && fresh->block.last - at + 1 > taken + 1) next = fresh;
    if (!next) next = single(at, late_s);
    found.push_back(next->block);
    at = next->block.last + 1;
    speed = next->block.feed_mm_per_min / 60.0;
    late_s = next->late_s;
    if (is_joint(at)) {  // other lines are here, or a program may be restarted here
      speed = 0.0;
      late_s = 0.0;
    }
  }
  return found;
}

bool LinearFit::is_joint(std::size_t block) const noexcept {
  return std::ranges::binary_search(joints_, static_cast<std::uint32_t>(block));
}

double LinearFit::duration_s(std::size_t at, std::size_t end) const noexcept {
  return static_cast<double>(command_.knots[end] - command_.knots[at]) * period_s_;
}

double LinearFit::speed_at(std::size_t knot) const noexcept {
  const std::size_t m = command_.knots[knot];
  const std::size_t before = m == 0 ? 0 : m - 1;
  const std::size_t after = std::min(m + 1, command_.points.size() - 1);
  return (command_.points[after] - command_.points[before]).norm() / (static_cast<double>(after - before) * period_s_);
}

// Excess of the speeds at the ends over those of the command, so that the block keeps its mean speed: the mean over
// time of a speed that is linear over the path is the logarithmic mean of those at its ends.
double LinearFit::bias(std::size_t at, std::size_t end) const noexcept {
  const double before = speed_at(at);
  const double after = speed_at(end);
  return (after - before) * (after - before) / (6.0 * std::max(before + after, 1e-9));
}

// The block alone. Where the command accelerates its feed is linear too: one kind of interpolation throughout. A shaper
// leaves no vibration after a command that is interpolated in one way between the ends of its periods; a constant feed
// here and there is a bow of a T^2 / 8 compared with the others, and excites the modes.
LinearFit::Timed LinearFit::single(std::size_t at, double late_s) {
  const double before = speed_at(at);
  const double after = speed_at(at + 1);
  const bool is_short = command_.knots[at + 1] - command_.knots[at] == 1;
  const std::optional<Shape>& own = shape(at, at + 1);
  if (is_short && own && std::abs(after - before) * period_s_ > 2.0 * tolerance_mm_) {
    const double whole_s = duration_s(at, at + 1);
    const double start = at > 0 ? written(before + bias(at, at + 1)) : 0.0;
    const std::optional<double> exact = linear_end_speed(own->length_mm, start, whole_s - late_s);
    if (exact && written(*exact) > 0.0) {
      const double last = written(*exact);
      const double late = late_s + linear_duration_s(own->length_mm, start, last) - whole_s;
      return {made(at, at + 1, *own, {start, last}, true), late};
    }
  }
  return constant(at, late_s);
}

LinearBlock LinearFit::made(std::size_t at, std::size_t end, const Shape& shape, std::pair<double, double> speeds,
                            bool sets_feed) const {
  return {.first = static_cast<std::uint32_t>(at),
          .last = static_cast<std::uint32_t>(end - 1),
          .end_mm = command_.points[command_.knots[end]],
          .radius_mm = shape.radius_mm,
          .sweep_rad = shape.sweep_rad,
          .length_mm = shape.length_mm,
          .normal = segments_[at].normal,
          .start_feed_mm_per_min = speeds.first * 60.0,
          .feed_mm_per_min = speeds.second * 60.0,
          .sets_feed = sets_feed,
          .is_linear = true};
}

// The block as it was; it makes up for what the one before was late.
LinearFit::Timed LinearFit::constant(std::size_t at, double late_s) const {
  const Segment& segment = segments_[at];
  const double whole_s = duration_s(at, at + 1);
  const double feed = std::nearbyint(segment.length_mm / (whole_s - late_s) * 60.0 * 1e4) / 1e4;
  const bool is_arc = segment.sweep_rad != 0.0;
  const Shape shape{segment.length_mm, is_arc ? segment.start_radius_mm : 0.0, segment.sweep_rad, {}, {}};
  LinearBlock block = made(at, at + 1, shape, {feed / 60.0, feed / 60.0}, false);
  block.start_feed_mm_per_min = block.feed_mm_per_min = feed;
  block.is_linear = false;
  return {block, late_s + block.duration_s() - whole_s};
}

// The longest block whose feed at its start is free.
LinearFit::Found LinearFit::begun(std::size_t at, double late_s) {
  const double speed = at > 0 ? speed_at(at) : 0.0;
  if (speed * period_s_ > tolerance_mm_) return longest(at, std::nullopt, late_s);
  Found found;
  for (std::size_t end = at + 1; end < std::min(at + 1 + longest_start, size()); ++end) {
    // From rest: the speed that leads to that of the command.
    const std::optional<Shape>& own = shape(at, end);
    if (!own) continue;
    const std::optional<double> start = linear_end_speed(own->length_mm, speed_at(end), duration_s(at, end) - late_s);
    if (!start || written(*start) <= 0.0) continue;
    if (const Found next = block(at, end, written(*start), late_s, true)) found = next;
  }
  return found;
}

LinearFit::Found LinearFit::longest(std::size_t at, std::optional<double> speed, double late_s) {
  Found found;
  int misses = 0;
  for (std::size_t end = at + 1; end <= std::min(at + longest_block, size()); ++end) {
    const double start = speed ? *speed : written(speed_at(at) + bias(at, end));
    const Found next = block(at, end, start, late_s, !speed);
    misses = next ? 0 : misses + 1;
    if (next) found = next;
    if (misses > most_misses || is_joint(end)) break;
  }
  return found;
}

// A block between two ends, if its motion stays within the tolerance.
LinearFit::Found LinearFit::block(std::size_t at, std::size_t end, double speed, double late_s, bool sets_feed) {
  const std::optional<Shape>& own = shape(at, end);
  if (!own) return std::nullopt;
  const double whole_s = duration_s(at, end);
  const double time_s = whole_s - late_s;
  const std::optional<double> exact = linear_end_speed(own->length_mm, speed, time_s);
  if (!exact) return std::nullopt;
  const double wanted = end < size() ? speed_at(end) + bias(at, end) : *exact;
  const double slack_s = time_share * tolerance_mm_ / std::max({speed, wanted, *exact});
  const double slowest = linear_end_speed(own->length_mm, speed, time_s + slack_s).value_or(*exact);
  const double fastest = linear_end_speed(own->length_mm, speed, time_s - slack_s).value_or(*exact);
  const double last = written(std::min(std::max(wanted, slowest), fastest));
  if (last <= 0.0 || std::abs(last - wanted) * period_s_ > speed_share * tolerance_mm_) return std::nullopt;
  const double late = late_s + linear_duration_s(own->length_mm, speed, last) - whole_s;
  if (std::abs(late) * std::max(last, wanted) > 2.0 * time_share * tolerance_mm_) return std::nullopt;
  for (std::size_t k = 0; k < own->along_mm.size(); ++k) {
    const double time = static_cast<double>(k + 1) * period_s_ - late_s;
    const double along = linear_distance_mm(own->length_mm, speed, last, time) - own->along_mm[k];
    if (std::hypot(along, own->aside_mm[k]) > tolerance_mm_) return std::nullopt;
  }
  return Timed{made(at, end, *own, {speed, last}, sets_feed), late};
}

// Kept for one start: the same blocks are tried with several feeds.
const std::optional<LinearFit::Shape>& LinearFit::shape(std::size_t at, std::size_t end) {
  if (at != shapes_at_) {
    std::ranges::fill(shapes_, std::nullopt);
    shapes_at_ = at;
  }
  auto& kept = shapes_[end - at];
  if (!kept) kept = shape_between(at, end);
  return *kept;
}

std::optional<LinearFit::Shape> LinearFit::shape_between(std::size_t at, std::size_t end) const {
  const Segment& segment = segments_[at];
  const std::span<const Vector3> points =
      std::span(command_.points).subspan(command_.knots[at], command_.knots[end] - command_.knots[at] + 1);
  const std::size_t inner = points.size() - 2;
  if (end == at + 1 && segment.sweep_rad != 0.0) {
    Shape shape{segment.length_mm, segment.start_radius_mm, segment.sweep_rad, {}, std::vector<double>(inner, 0.0)};
    for (std::size_t k = 1; k <= inner; ++k) {
      shape.along_mm.push_back(segment.length_mm * static_cast<double>(k) / static_cast<double>(points.size() - 1));
    }
    return shape;
  }
  const Vector3 chord = points.back() - points.front();
  const double length = chord.norm();
  if (length == 0.0) return std::nullopt;
  Shape line{length, 0.0, 0.0, {}, {}};
  double largest = 0.0;
  for (std::size_t k = 1; k <= inner; ++k) {
    const Vector3 from_start = points[k] - points.front();
    const double along = from_start.dot(chord) / length;
    line.along_mm.push_back(along);
    line.aside_mm.push_back((from_start - along * chord / length).norm());
    largest = std::max(largest, line.aside_mm.back());
  }
  if (largest <= line_share * tolerance_mm_) return line;
  return arc(points, length, segment.normal);
}

std::optional<LinearFit::Shape> LinearFit::arc(std::span<const Vector3> points, double chord_mm, int normal) const {
  const bool is_flat = std::ranges::all_of(points, [&](const Vector3& p) { return p[normal] == points[0][normal]; });
  if (!is_flat || chord_mm < least_arc_mm) return std::nullopt;
  const auto flat = [&](const Vector3& p) { return std::complex<double>(p[(normal + 1) % 3], p[(normal + 2) % 3]); };
  const std::complex<double> begin = flat(points.front());
  // The chord along the first axis.
  const std::complex<double> turn = chord_mm / (flat(points.back()) - begin);
  const auto turned = [&](const Vector3& p) { return (flat(p) - begin) * turn; };
  const double half = 0.5 * chord_mm;
  const std::complex<double> middle = turned(points[points.size() / 2]);
  const double height = middle.imag();
  const double x = middle.real() - half;
  if (height == 0.0) return std::nullopt;
  // x^2 + (height - y)^2 = half^2 + y^2: the centre is at y on the middle of the chord.
  double y = (x * x + height * height - half * half) / (2.0 * height);
  const double radius = std::nearbyint(std::hypot(half, y) * 1e3) / 1e3;
  if (radius <= half || radius > most_radius_mm) return std::nullopt;
  y = -std::copysign(std::sqrt(radius * radius - half * half), height);
  const double sweep = -std::copysign(2.0 * std::asin(half / radius), height);
  if (std::abs(sweep) > max_sweep_rad) return std::nullopt;
  const std::complex<double> centre(half, y);
  Shape shape{radius * std::abs(sweep), radius, sweep, {}, {}};
  for (std::size_t k = 1; k + 1 < points.size(); ++k) {
    const std::complex<double> spoke = turned(points[k]) - centre;
    shape.along_mm.push_back(radius * std::abs(std::arg(spoke / -centre)));
    shape.aside_mm.push_back(std::abs(std::abs(spoke) - radius));
  }
  return shape;
}

}  // namespace shapegcode
