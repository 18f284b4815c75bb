#include "shapegcode/planner_models.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "base/checks.hpp"
#include "limits/speed_limits.hpp"
#include "motion/phase_maker.hpp"
#include "motion/pieces.hpp"
#include "motion/planner_rules.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// grbl treats two moves as a straight line or a reversal if the cosine of their angle is within this of 1.
constexpr double straight_cosine = 0.999999;

// Equal parts of a segment as lines between points on it.
void add_chords(const Segment& segment, double count, PathBuilder& builder) {
  Vector3 start = segment.start_mm;
  for (double i = 1.0; i <= count; ++i) {
    const Vector3 end = i < count ? point_at(segment, segment.length_mm * i / count) : segment.end_mm;
    Segment chord = make_line(start, end, segment.feed_mm_per_s, segment.line);
    chord.stop_at_end = segment.stop_at_end && i == count;
    builder.add(chord);
    start = end;
  }
}

double chord_count(const Segment& arc, const PlannerRules& rules) noexcept {
  if (rules.chord_tolerance_mm > 0.0) return chords_within(arc, rules.chord_tolerance_mm);
  if (rules.kind == ControllerKind::klipper) return std::max(1.0, std::floor(arc.length_mm / rules.arc_resolution_mm));
  // A chord of a circle of radius r is off by the tolerance e at a half angle whose sine is sqrt(e (2 r - e)) / r.
  const double radius = arc.start_radius_mm;
  const double reach = rules.arc_tolerance_mm * (2.0 * radius - rules.arc_tolerance_mm);
  if (!(reach > 0.0)) return 1.0;
  return std::max(1.0, std::floor(0.5 * std::abs(arc.sweep_rad) * radius / std::sqrt(reach)));
}

double least_share_limit(const Vector3& direction, const Vector3& limit) noexcept {
  double least = MotionLimits::none;
  for (int i = 0; i < axis_count; ++i) {
    if (direction[i] != 0.0) least = std::min(least, limit[i] / std::abs(direction[i]));
  }
  return least;
}

// Speed of a corner: that of an arc that cuts it by a deviation: with s = sin(theta/2), theta the inner angle
// of the corner, the arc has the radius deviation s / (1 - s).
double corner_radius_mm(double inner_half_sine, double deviation_mm) noexcept {
  return inner_half_sine < 1.0 ? deviation_mm * inner_half_sine / (1.0 - inner_half_sine) : MotionLimits::none;
}

double grbl_junction(const Vector3& before, const Vector3& after, const MotionLimits& limits,
                     const PlannerRules& rules) noexcept {
  const double cosine = before.dot(after);
  if (cosine > straight_cosine) return MotionLimits::none;
  if (cosine < -straight_cosine) return 0.0;
  const double acceleration = least_share_limit((after - before).normalized(), limits.max_acceleration_mm_per_s2);
  return std::sqrt(acceleration * corner_radius_mm(std::sqrt(0.5 * (1.0 + cosine)), rules.junction_deviation_mm));
}

std::vector<Piece> grbl_pieces(const Path& path, const MotionLimits& limits, const PlannerRules& rules) {
  std::vector<Piece> pieces;
  pieces.reserve(path.size());
  Vector3 before = Vector3::Zero();
  for (const Segment& segment : path.segments()) {
    if (!(segment.length_mm > 0.0)) continue;
    const Vector3 along = tangent_at(segment, 0.0);
    Piece piece;
    piece.length = segment.length_mm;
    piece.limit = detail::planned_feed(segment, limits, least_share_limit(along, limits.max_feed_mm_per_s));
    piece.acceleration = least_share_limit(along, limits.max_acceleration_mm_per_s2);
    piece.start_speed = pieces.empty() ? 0.0 : grbl_junction(before, along, limits, rules);
    pieces.push_back(piece);
    before = along;
  }
  // The block that runs is one of the buffer's: behind it one less is known.
  detail::pass_speeds_within(pieces, rules.look_ahead_blocks - 1);
  return pieces;
}

// Moves of Klipper: limits as its kinematics of three straight axes has them. X and Y have one limit, the smaller.
struct KlipperMove {
  Piece piece;
  double smoothed_acceleration = 0.0;  // that of max_accel_to_decel
  Vector3 along = Vector3::Zero();
};

KlipperMove klipper_move(const Segment& segment, const MotionLimits& limits, const PlannerRules& rules) {
  const auto smaller = [](const Vector3& limit) { return std::min(limit[0], limit[1]); };
  KlipperMove move;
  move.along = tangent_at(segment, 0.0);
  double feed = smaller(limits.max_feed_mm_per_s);
  double acceleration = smaller(limits.max_acceleration_mm_per_s2);
  move.smoothed_acceleration = acceleration * (1.0 - rules.minimum_cruise_ratio);
  if (const double climb = std::abs(move.along[2]); climb > 0.0) {
    feed = std::min(feed, limits.max_feed_mm_per_s[2] / climb);
    acceleration = std::min(acceleration, limits.max_acceleration_mm_per_s2[2] / climb);
  }
  move.smoothed_acceleration = std::min(move.smoothed_acceleration, acceleration);
  move.piece = {segment.length_mm, detail::planned_feed(segment, limits, feed), acceleration, 0.0};
  return move;
}

// The corner as an arc by a deviation that follows from the square corner velocity v: v^2 (sqrt 2 - 1) / a. That arc
// must touch no move beyond its middle.
double klipper_junction(const KlipperMove& before, const KlipperMove& after, const PlannerRules& rules,
                        double max_acceleration) noexcept {
  const double cosine = std::clamp(before.along.dot(after.along), -1.0, 1.0);
  const double sine_half = std::sqrt(0.5 * (1.0 + cosine));  // of the inner angle
  const double cosine_half = std::sqrt(0.5 * (1.0 - cosine));
  if (!(sine_half < 1.0) || !(cosine_half > 0.0)) return MotionLimits::none;
  const double corner = rules.square_corner_velocity_mm_per_s;
  const double deviation = corner * corner * (std::sqrt(2.0) - 1.0) / max_acceleration;
  const double least = std::min(before.piece.acceleration, after.piece.acceleration);
  const double tangent = 0.5 * sine_half / cosine_half;
  return std::sqrt(std::min({least * corner_radius_mm(sine_half, deviation),
                             before.piece.length * before.piece.acceleration * tangent,
                             after.piece.length * after.piece.acceleration * tangent}));
}

// Squares of the speeds at which moves are entered, and one behind the last: as fast as the corner and the acceleration
// let them be.
template <class Acceleration>
std::vector<double> entry_squares(const std::vector<KlipperMove>& moves, Acceleration&& acceleration) {
  const std::size_t n = moves.size();
  std::vector<double> squares(n + 1, 0.0);
  for (std::size_t i = 1; i < n; ++i) {
    const double corner = moves[i].piece.start_speed;
    squares[i] =
        std::min(corner * corner, squares[i - 1] + 2.0 * acceleration(moves[i - 1]) * moves[i - 1].piece.length);
  }
  for (std::size_t i = n; i-- > 0;) {
    squares[i] = std::min(squares[i], squares[i + 1] + 2.0 * acceleration(moves[i]) * moves[i].piece.length);
  }
  return squares;
}

// Under the lower acceleration of max_accel_to_decel a row of moves rises and falls; none may be faster than the top of
// its hill, and one that falls all along no faster than where it begins. Squares of the speeds that are left.
std::vector<double> cruise_squares(const std::vector<KlipperMove>& moves, const std::vector<double>& start,
                                   const std::vector<double>& smoothed) {
  const std::size_t n = moves.size();
  std::vector<double> cruise(n);
  const auto rise = [&](std::size_t i) { return 2.0 * moves[i].smoothed_acceleration * moves[i].piece.length; };
  const auto falls = [&](std::size_t i) { return smoothed[i] >= smoothed[i + 1] + rise(i); };
  for (std::size_t i = n; i-- > 0;) {
    if (falls(i)) continue;
    const bool rises_on = i + 1 < n && !falls(i + 1) && smoothed[i] + rise(i) <= smoothed[i + 1];
    const double limit = moves[i].piece.limit;
    cruise[i] = rises_on ? cruise[i + 1] : std::min(limit * limit, 0.5 * (smoothed[i] + smoothed[i + 1] + rise(i)));
  }
  for (std::size_t i = 1; i < n; ++i) {
    if (falls(i)) cruise[i] = std::min(cruise[i - 1], start[i]);
  }
  return cruise;
}

std::vector<KlipperMove> klipper_moves(const Path& path, const MotionLimits& limits, const PlannerRules& rules) {
  std::vector<KlipperMove> moves;
  moves.reserve(path.size());
  const double most = std::min(limits.max_acceleration_mm_per_s2[0], limits.max_acceleration_mm_per_s2[1]);
  for (const Segment& segment : path.segments()) {
    if (!(segment.length_mm > 0.0)) continue;
    KlipperMove move = klipper_move(segment, limits, rules);
    if (!moves.empty()) {
      move.piece.start_speed =
          std::min({moves.back().piece.limit, move.piece.limit, klipper_junction(moves.back(), move, rules, most)});
    }
    moves.push_back(move);
  }
  return moves;
}

std::vector<Piece> klipper_pieces(const Path& path, const MotionLimits& limits, const PlannerRules& rules) {
  const std::vector<KlipperMove> moves = klipper_moves(path, limits, rules);
  const std::size_t n = moves.size();
  const std::vector<double> start =
      entry_squares(moves, [](const KlipperMove& move) { return move.piece.acceleration; });
  const std::vector<double> smoothed =
      entry_squares(moves, [](const KlipperMove& move) { return move.smoothed_acceleration; });
  const std::vector<double> cruise = cruise_squares(moves, start, smoothed);
  std::vector<Piece> pieces;
  pieces.reserve(n);
  double entry = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    Piece piece = moves[i].piece;
    piece.start_speed = std::sqrt(entry);
    piece.limit = std::min(piece.limit, std::sqrt(cruise[i]));
    entry = std::min({start[i + 1], cruise[i], i + 1 < n ? cruise[i + 1] : 0.0});
    pieces.push_back(piece);
  }
  return pieces;
}

// Arcs as chords; the path itself where it has none.
std::shared_ptr<const Path> chorded_path(const std::shared_ptr<const Path>& path, const PlannerRules& rules) {
  bool has_arcs = false;
  for (std::size_t i = 0; i < path->size() && !has_arcs; ++i) has_arcs = path->is_arc(i);
  if (!has_arcs) return path;
  PathBuilder builder;
  for (const Segment& segment : path->segments()) {
    if (segment.kind == SegmentKind::arc) {
      add_chords(segment, chord_count(segment, rules), builder);
    } else {
      builder.add(segment);
    }
  }
  return std::make_shared<const Path>(builder.path());
}

}  // namespace

namespace detail {

double planned_feed(const Segment& segment, const MotionLimits& limits, double most) {
  const double feed = std::min(segment.feed_mm_per_s * limits.feed_override, most);
  if (!(feed > 0.0) || !std::isfinite(feed)) {
    throw Error(ErrorKind::argument, "segment without a feed greater than zero", segment.line);
  }
  return feed;
}

void pass_speeds_within(std::vector<Piece>& pieces, std::size_t look_ahead) {
  const std::size_t n = pieces.size();
  for (std::size_t i = 0; i < n; ++i) {
    double& start = pieces[i].start_speed;
    start = i == 0 ? 0.0 : std::min({start, pieces[i].limit, pieces[i - 1].limit});
  }
  double speed = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    // From rest at the end of the last piece that is known, backwards.
    double behind = 0.0;
    for (std::size_t k = std::min(n, i + look_ahead); k-- > i;) {
      behind = std::min(pieces[k].start_speed, speed_beyond(pieces[k], behind));
    }
    pieces[i].start_speed = std::min(speed, behind);
    speed = speed_beyond(pieces[i], pieces[i].start_speed);
  }
}

SpeedProfile profile_of(const std::vector<Piece>& pieces, double length_mm) {
  MotionLimits plain;
  plain.law = AccelerationLaw::jerk_limited;
  PhaseMaker maker(plain);
  maker.ready().reserve(max_phases * pieces.size());
  std::array<Ramp, max_phases> ramps;
  for (std::size_t i = 0; i < pieces.size(); ++i) {
    const double end_speed = i + 1 < pieces.size() ? pieces[i + 1].start_speed : 0.0;
    const std::size_t count = ramps_of(pieces[i], pieces[i].start_speed, end_speed, maker.length_mm(), ramps);
    for (std::size_t k = 0; k < count; ++k) maker.add(ramps[k]);
  }
  maker.end();
  return {std::move(maker.ready()), length_mm, 0.0};
}

}  // namespace detail

void check(const PlannerRules& rules) {
  require_within(rules.arc_resolution_mm, 1e-3, 100.0, "arc resolution", "mm");
  require_within(rules.chord_tolerance_mm, 0.0, 10.0, "tolerance of chords", "mm");
  require_within(rules.arc_tolerance_mm, 1e-5, 10.0, "arc tolerance", "mm");
  require_within(rules.square_corner_velocity_mm_per_s, 0.0, 1000.0, "square corner velocity", "mm/s");
  require(rules.minimum_cruise_ratio >= 0.0 && rules.minimum_cruise_ratio < 1.0, "minimum cruise ratio",
          rules.minimum_cruise_ratio, "", "0 to below 1");
  require_within(rules.junction_deviation_mm, 1e-6, 10.0, "junction deviation", "mm");
  require_within(rules.period_s, 1e-5, 0.1, "servo period", "s");
  require_within(rules.blend_tolerance_mm, 0.0, 100.0, "blend tolerance", "mm");
  require_within(rules.naive_cam_tolerance_mm, 0.0, 100.0, "tolerance of naive CAM output", "mm");
  require_within(rules.ramp_frequency_hz, 1e-3, 1e6, "ramp frequency", "Hz");
  require_within(rules.kink_ratio, 1e-3, 1.0, "kink ratio", "");
  require_within(rules.max_feed_override, 0.01, 100.0, "largest feed override", "");
  require(rules.optimization_depth >= 2 && rules.optimization_depth <= 4096, "optimization depth",
          static_cast<double>(rules.optimization_depth), "", "2 to 4096");
  require(rules.look_ahead_blocks >= 2 && rules.look_ahead_blocks <= 4096, "blocks of the planner's buffer",
          static_cast<double>(rules.look_ahead_blocks), "", "2 to 4096");
}

ControlledMotion controlled_motion(const std::shared_ptr<const Path>& path, const MotionLimits& limits,
                                   const PlannerRules& rules) {
  if (rules.kind == ControllerKind::fanuc) {
    return {path, std::make_shared<const SpeedProfile>(plan_speed(*path, limits))};
  }
  check(rules);
  check_limits(limits, {});
  for (int i = 0; i < axis_count; ++i)
    require_above_zero(limits.max_acceleration_mm_per_s2[i], "acceleration", "mm/s2");
  if (rules.kind == ControllerKind::linuxcnc && path->length_mm() > 0.0) {
    return detail::linuxcnc_motion(*path, limits, rules);
  }
  ControlledMotion motion{chorded_path(path, rules), nullptr};
  const double length_mm = motion.path->length_mm();
  std::vector<Piece> pieces;
  if (length_mm > 0.0) {
    pieces = rules.kind == ControllerKind::klipper ? klipper_pieces(*motion.path, limits, rules)
                                                   : grbl_pieces(*motion.path, limits, rules);
  }
  motion.profile = std::make_shared<const SpeedProfile>(detail::profile_of(pieces, length_mm));
  return motion;
}

}  // namespace shapegcode
