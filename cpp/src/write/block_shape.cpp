#include "write/block_shape.hpp"
#include "path/arc_frame.hpp"

#include <algorithm>
#include <cmath>

namespace shapegcode {
namespace {

constexpr double largest_radius_increments = 99999999.0;  // a word has eight digits
// Periods by which a block ends before its last interpolation period: far above the round-off of any controller, far
// below any significant time.
constexpr double tick_margin = 1e-4;
// Distance, and share of its time, that a block may stand still at its end for the sake of a shorter F, and by which an
// arc's middle may be off for the sake of a shorter R, in increments: a tenth of what an end is off by its rounding.
constexpr double negligible_increments = 0.25;
constexpr double negligible_share = 0.005;
constexpr double tie_slope = 1e-7;  // increments: far over the noise of positions, far under what matters

}  // namespace

Eigen::Vector2d ChordArc::at(double fraction) const {
  const double angle = sweep * (fraction - 0.5);
  const double forward = radius * std::sin(angle) + 0.5 * chord;
  const double bulge = radius * (std::cos(angle) - std::cos(0.5 * sweep));
  return start + forward * along + bulge_side * bulge * left;
}

BlockShape::BlockShape(const Eigen::Ref<const Eigen::MatrixXd>& grid, const Eigen::Ref<const Eigen::MatrixXd>& middle,
                       const FitOptions& options)
    : grid_(grid),
      middle_(middle),
      options_(options),
      ticks_per_period_(std::lround(options.block_period_s / options.interpolation_period_s)) {}

BlockPosition BlockShape::rounded(std::uint32_t k) const {
  BlockPosition result;
  for (int i = 0; i < axis_count; ++i) {
    // A command that moves by whole increments may stay half between two: without a slope to one side the noise of its
    // last digits would round it now up and now down, and no steady line would be one.
    result[static_cast<std::size_t>(i)] = std::llround(grid_(k, i) / options_.increment_mm + tie_slope);
  }
  return result;
}

Vector3 BlockShape::to_mm(const BlockPosition& p) const { return in_increments(p) * options_.increment_mm; }

std::optional<std::int64_t> BlockShape::feed(double length_mm, std::uint32_t periods) const {
  const auto wanted = static_cast<double>(periods * ticks_per_period_);
  const auto early = [&](std::int64_t value) {
    const double speed = static_cast<double>(value) * options_.feed_unit_mm_per_s;
    return wanted * options_.interpolation_period_s * speed - length_mm;  // travel not used, mm
  };
  const auto last_period = [&](std::int64_t value) {
    return static_cast<double>(value) * options_.feed_unit_mm_per_s * options_.interpolation_period_s;
  };
  const std::int64_t up = nearest_feed(length_mm, periods);
  if (early(up) <= 0.5 * options_.increment_mm && early(up) < (1.0 - tick_margin) * last_period(up)) {
    return up;
  }
  const std::int64_t exact =
      std::llround(length_mm / (wanted * options_.interpolation_period_s) / options_.feed_unit_mm_per_s);
  if (exact >= options_.minimum_feed && early(exact) >= -1e-12 * length_mm && early(exact) <= 1e-9 * length_mm) {
    return exact;
  }
  return std::nullopt;
}

std::int64_t BlockShape::nearest_feed(double length_mm, std::uint32_t periods) const {
  const double ticks = static_cast<double>(periods * ticks_per_period_) - tick_margin;
  const double exact = length_mm / (ticks * options_.interpolation_period_s) / options_.feed_unit_mm_per_s;
  return std::max(options_.minimum_feed, static_cast<std::int64_t>(std::ceil(exact)));
}

BlockShape::FeedRange BlockShape::feeds_like(const FittedBlock& block, double length_mm) const {
  const double time_s = static_cast<double>(block.periods * ticks_per_period_) * options_.interpolation_period_s;
  const double unit = options_.feed_unit_mm_per_s;
  const double in_time = (length_mm + negligible_increments * options_.increment_mm) / (time_s * unit);
  const double in_last_period = length_mm / ((time_s - (1.0 - tick_margin) * options_.interpolation_period_s) * unit);
  const double hardly_faster = static_cast<double>(block.feed) * (1.0 + negligible_share);
  const auto most = static_cast<std::int64_t>(std::floor(std::min({in_time, in_last_period, hardly_faster})));
  return {block.feed, std::max(block.feed, most)};
}

double BlockShape::length_mm(const BlockPosition& from, const FittedBlock& block) const {
  const Vector3 travel = to_mm(block.end) - to_mm(from);
  if (block.kind == FittedKind::line) {
    return travel.norm();
  }
  const ChordArc arc = arc_of(from, block);
  return std::hypot(arc.radius * arc.sweep, travel[block.normal]);
}

void BlockShape::set_feed(FittedBlock& block, double length_mm) const {
  auto f = feed(length_mm, block.periods);
  if (!f) {
    // No F is slower than the least: at once to the periods that it takes.
    const double least = static_cast<double>(options_.minimum_feed) * options_.feed_unit_mm_per_s;
    const double longest = std::floor(length_mm / (least * options_.block_period_s)) + 2.0;
    if (longest < block.periods) {
      block.periods = static_cast<std::uint32_t>(longest);
      f = feed(length_mm, block.periods);
    }
  }
  while (!f && block.periods > 1) {
    f = feed(length_mm, --block.periods);
  }
  block.feed = f ? *f : nearest_feed(length_mm, block.periods);
}

std::optional<ChordArc> BlockShape::chord_arc(const BlockPosition& from, const BlockPosition& to, int normal,
                                              const Eigen::Vector2d& middle) const {
  const ArcFrame frame(normal);
  const Vector3 p = to_mm(from);
  ChordArc arc;
  arc.start = frame.project(p);
  const Eigen::Vector2d chord = frame.offset(p, to_mm(to));
  arc.chord = chord.norm();
  if (arc.chord < options_.arc_min_chord_mm) {
    return std::nullopt;
  }
  arc.along = chord / arc.chord;
  arc.left = {-arc.along.y(), arc.along.x()};
  const double height = (middle - (arc.start + 0.5 * chord)).dot(arc.left);
  if (std::abs(height) < 0.25 * options_.increment_mm) {
    return std::nullopt;
  }
  const double radius = (0.25 * arc.chord * arc.chord + height * height) / (2.0 * std::abs(height));
  if (radius / options_.increment_mm > largest_radius_increments) {
    return std::nullopt;
  }
  arc.radius = static_cast<double>(short_radius(radius / options_.increment_mm, arc.chord / options_.increment_mm)) *
               options_.increment_mm;
  if (0.5 * arc.chord >= arc.radius) {
    return std::nullopt;
  }
  arc.sweep = 2.0 * std::asin(0.5 * arc.chord / arc.radius);
  arc.bulge_side = height > 0.0 ? 1.0 : -1.0;
  if (arc.sweep > options_.max_sweep_rad) {
    return std::nullopt;
  }
  return arc;
}

// The radius with the fewest digits whose arc has its middle where that of the exact one is.
std::int64_t BlockShape::short_radius(double radius, double chord) const {
  const auto height = [half = 0.5 * chord](double r) { return r - std::sqrt(std::max(0.0, r * r - half * half)); };
  std::int64_t step = 1;
  for (std::int64_t next = 10; static_cast<double>(next) <= radius; next *= 10) {
    const double trial = std::round(radius / static_cast<double>(next)) * static_cast<double>(next);
    if (trial <= 0.5 * chord || std::abs(height(trial) - height(radius)) > negligible_increments) {
      break;
    }
    step = next;
  }
  return std::llround(radius / static_cast<double>(step)) * step;
}

ChordArc BlockShape::arc_of(const BlockPosition& from, const FittedBlock& block) const {
  const ArcFrame frame(block.normal);
  const Vector3 p = to_mm(from);
  const Eigen::Vector2d chord = frame.offset(p, to_mm(block.end));
  ChordArc arc;
  arc.start = frame.project(p);
  arc.chord = chord.norm();
  arc.along = chord / arc.chord;
  arc.left = {-arc.along.y(), arc.along.x()};
  arc.radius = static_cast<double>(block.radius) * options_.increment_mm;
  arc.sweep = 2.0 * std::asin(0.5 * arc.chord / arc.radius);
  // Counter-clockwise turns left, so its path bulges to the right of the chord.
  arc.bulge_side = block.kind == FittedKind::counter_clockwise ? -1.0 : 1.0;
  return arc;
}

std::optional<FittedBlock> BlockShape::arc(const BlockPosition& from, const BlockPosition& end, Over over, int normal,
                                           std::uint32_t periods, double tolerance_increments) const {
  const auto [k, j] = over;
  const int a = ArcFrame(normal).a;
  const int b = ArcFrame(normal).b;
  const std::uint32_t m = j - k;
  Eigen::Vector2d middle;
  if (m % 2 == 1) {
    middle = {middle_(k + m / 2, a), middle_(k + m / 2, b)};
  } else {
    middle = {grid_(k + m / 2, a), grid_(k + m / 2, b)};
  }
  // The chord is rounded, the middle is not: move the middle with the chord's own rounding.
  const Vector3 p = to_mm(from);
  const Vector3 q = to_mm(end);
  middle += 0.5 * Eigen::Vector2d(p[a] - grid_(k, a) + q[a] - grid_(j, a), p[b] - grid_(k, b) + q[b] - grid_(j, b));
  const auto arc = chord_arc(from, end, normal, middle);
  if (!arc) {
    return std::nullopt;
  }
  if (m > 1) {
    const double tolerance = tolerance_increments * options_.increment_mm;
    for (std::uint32_t i = 1; i < m; ++i) {
      const double fraction = static_cast<double>(i) / m;
      const Eigen::Vector2d at = arc->at(fraction);
      const double along_normal = p[normal] + (q[normal] - p[normal]) * fraction;
      if (std::abs(at.x() - grid_(k + i, a)) > tolerance || std::abs(at.y() - grid_(k + i, b)) > tolerance ||
          std::abs(along_normal - grid_(k + i, normal)) > tolerance) {
        return std::nullopt;
      }
    }
  }
  const double length = std::hypot(arc->radius * arc->sweep, q[normal] - p[normal]);
  const auto f = feed(length, periods);
  if (!f && m > 1) {
    return std::nullopt;
  }
  const FittedKind kind = arc->bulge_side < 0.0 ? FittedKind::counter_clockwise : FittedKind::clockwise;
  return FittedBlock{end,
                     std::llround(arc->radius / options_.increment_mm),
                     f ? *f : nearest_feed(length, periods),
                     k,
                     periods,
                     kind,
                     static_cast<std::uint8_t>(normal)};
}

}  // namespace shapegcode
