#include "shapegcode/measure/contour.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/refuse.hpp"
#include "path/arc_frame.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

constexpr double two_pi = 2.0 * std::numbers::pi;
constexpr double window_margin_mm = 1e-3;
constexpr double longest_retreat_mm = 10.0;
constexpr double longest_turn_mm = 2.0;
// Two feet are equally near if their squared distances differ by no more than round-off.
constexpr double tie_relative = 1e-9;
constexpr double tie_absolute_mm2 = 1e-18;
constexpr double retreat_tie_relative = 1e-6;
constexpr double retreat_tie_absolute_mm2 = 1e-16;
// A component of the deviation or the travel below this share of the whole is rounding.
constexpr double negligible_share = 1e-6;
constexpr std::uint32_t growing_until_lost = 8;  // and at every power of two from there
constexpr double widest_local_window_rad = 1.0;
// Segments that lie further away than the best foot are passed in groups.
constexpr std::size_t group_size = 16;  // a power of two
constexpr double group_slack = 1e-6;
constexpr double group_slack_mm = 1e-6;
// Directions of a straight section lie within 5.7 degrees of one, hence 11.5 of each other: then no other segment of it
// is nearer than a foot that lies further from both ends of its segment than .104 of the deviation.
constexpr double straight_cosine2 = 0.99;
constexpr double nearest_share = 0.125;
constexpr double nearest_margin_mm = 1e-5;

}  // namespace

void DeviationStats::include_missed(double distance_mm) noexcept { max_abs_mm = std::max(max_abs_mm, distance_mm); }

void DeviationStats::include_extremes(const DeviationStats& others) noexcept {
  max_abs_mm = std::max(max_abs_mm, others.max_abs_mm);
  most_positive_mm = std::max(most_positive_mm, others.most_positive_mm);
  most_negative_mm = std::min(most_negative_mm, others.most_negative_mm);
}

double DeviationStats::rms_mm() const noexcept {
  return count == 0 ? 0.0 : std::sqrt(sum_of_squares_mm2 / static_cast<double>(count));
}

std::shared_ptr<const ContourTracker::Geometry> ContourTracker::geometry_of(const Path& path) {
  auto geometry = std::make_shared<Geometry>();
  if (path.size() == 0) refuse("contour error needs a path with at least one segment");
  geometry->path = path;
  for (std::size_t i = 0; i < path.size(); ++i) {
    std::int32_t index = -1;
    if (path.is_arc(i) && path[i].length_mm > 0.0) {
      index = static_cast<std::int32_t>(geometry->arcs.size());
      geometry->arcs.push_back(arc_of(path[i]));
    }
    geometry->arc_of.push_back(index);
  }
  return geometry;
}

ContourTracker::Arc ContourTracker::arc_of(const Segment& segment) noexcept {
  Arc arc;
  arc.segment = segment;
  arc.n = segment.normal;
  arc.a = ArcFrame(arc.n).a;
  arc.b = ArcFrame(arc.n).b;
  arc.cosine = std::cos(segment.start_angle_rad);
  arc.sine = std::sin(segment.start_angle_rad);
  arc.sense = segment.sweep_rad < 0.0 ? -1.0 : 1.0;
  arc.turn = std::abs(segment.sweep_rad);
  arc.radius_rate = (segment.end_radius_mm - segment.start_radius_mm) / arc.turn;
  arc.pitch = (segment.end_mm[arc.n] - segment.start_mm[arc.n]) / arc.turn;
  // Radii that differ by rounding only are one circle.
  if (std::abs(arc.radius_rate) * arc.turn < 1e-12 * segment.start_radius_mm) arc.radius_rate = 0.0;
  arc.start_tangent = tangent_at(segment, 0.0);
  arc.end_tangent = tangent_at(segment, segment.length_mm);
  return arc;
}

ContourTracker::NearSegment ContourTracker::near_segment_of(std::size_t i) const noexcept {
  NearSegment part = bare_segment_of(i);
  const Vector3& direction = part.direction;
  part.across2 = direction[0] * direction[0] + direction[1] * direction[1];
  part.has_side = part.across2 > negligible_share * negligible_share * direction.squaredNorm();
  return part;
}

ContourTracker::NearSegment ContourTracker::bare_segment_of(std::size_t i) const noexcept {
  const Path& path = geometry_->path;
  if (path.is_plain(i)) {
    const Vector3& start = path.start_mm(i);
    const Vector3 along = path.start_mm(i + 1) - start;
    const double length = along.norm();
    if (length > 0.0)
      return {start, along / length, length, path.distance_mm(i), path.distance_mm(i + 1), -1, false, 0.0};
  }
  const Segment segment = path[i];
  NearSegment part{segment.start_mm,
                   tangent_at(segment, 0.0),
                   segment.length_mm,
                   path.distance_mm(i),
                   path.distance_mm(i + 1),
                   geometry_->arc_of[i],
                   false,
                   0.0};
  // Segments without length take the direction of the end before them; at the start the one that follows.
  for (std::size_t k = i; !(part.length > 0.0) && part.direction.isZero(0.0) && k-- > 0;) {
    const Segment before = path[k];
    part.direction = tangent_at(before, before.length_mm);
  }
  for (std::size_t k = i; !(part.length > 0.0) && part.direction.isZero(0.0) && ++k < path.size();) {
    part.direction = tangent_at(path[k], 0.0);
  }
  return part;
}

ContourTracker::ContourTracker(const Path& path) : geometry_(geometry_of(path)) { last_ = path.start_mm(0); }

void ContourTracker::begin_at(double s_mm, const Vector3& p) noexcept {
  cursor_ = geometry_->path.segment_at(s_mm);
  const Vector3 foot = geometry_->path.point(s_mm, cursor_);
  s_ = furthest_ = s_mm;
  last_ = p;
  deviation_ = (p - foot).norm();
  growing_ = 0;
  straight_ = {};
  near_ = {std::numeric_limits<double>::infinity(), 0.0};
}

Vector3 ContourTracker::start_tangent(std::size_t index) const noexcept { return at(index).direction; }

Vector3 ContourTracker::end_tangent(std::size_t index) const noexcept {
  const NearSegment& of = at(index);
  return of.arc < 0 ? of.direction : geometry_->arcs[static_cast<std::size_t>(of.arc)].end_tangent;
}

inline ContourTracker::Foot ContourTracker::foot_on(const NearSegment& line, const Vector3& p,
                                                    const Window& window) const noexcept {
  if (line.arc >= 0) return foot_on_arc(line, p, window);
  Foot foot;
  const Vector3 from_start = p - line.start;
  const double along = std::clamp(from_start.dot(line.direction), 0.0, line.length);
  foot.offset = from_start - along * line.direction;
  foot.distance2 = foot.offset.squaredNorm();
  foot.along = along;
  return foot;
}

ContourTracker::Foot ContourTracker::arc_point_foot(const Arc& arc, double u, const Vector3& p) noexcept {
  const double c = std::cos(u);
  const double s = std::sin(u) * arc.sense;
  const double ea = arc.cosine * c - arc.sine * s;
  const double eb = arc.sine * c + arc.cosine * s;
  const double radius = arc.segment.start_radius_mm + arc.radius_rate * u;
  Foot foot;
  foot.offset[arc.a] = p[arc.a] - (arc.segment.centre_mm[arc.a] + radius * ea);
  foot.offset[arc.b] = p[arc.b] - (arc.segment.centre_mm[arc.b] + radius * eb);
  foot.offset[arc.n] = p[arc.n] - (arc.segment.start_mm[arc.n] + arc.pitch * u);
  foot.tangent[arc.a] = -arc.sense * radius * eb + arc.radius_rate * ea;
  foot.tangent[arc.b] = arc.sense * radius * ea + arc.radius_rate * eb;
  foot.tangent[arc.n] = arc.pitch;
  foot.distance2 = foot.offset.squaredNorm();
  return foot;
}

double ContourTracker::refined_foot(const Arc& arc, const Vector3& p, const Polar& polar, const Turns& turns,
                                    double u) noexcept {
  for (int iteration = 0; iteration < 8; ++iteration) {
    const double radius = arc.segment.start_radius_mm + arc.radius_rate * u;
    const double c = polar.radius * std::cos(u - polar.angle);
    const double s = polar.radius * std::sin(u - polar.angle);
    const double height = arc.segment.start_mm[arc.n] + arc.pitch * u - p[arc.n];
    const double slope = radius * arc.radius_rate - arc.radius_rate * c + radius * s + arc.pitch * height;
    const double bend =
        radius * c + 2.0 * arc.radius_rate * s + arc.radius_rate * arc.radius_rate + arc.pitch * arc.pitch;
    if (!(bend > 0.0)) break;
    const double next = std::clamp(u - slope / bend, turns.first, turns.last);
    const double moved = std::abs(next - u);
    u = next;
    if (moved < 1e-12) break;
  }
  return u;
}

// Angles `u` count from the arc's start in the sense of its turning, without wrapping.
ContourTracker::Foot ContourTracker::foot_on_arc(const NearSegment& base, const Vector3& p,
                                                 const Window& window) const noexcept {
  const Arc& arc = geometry_->arcs[static_cast<std::size_t>(base.arc)];
  const double rad_per_mm = arc.turn / base.length;
  const double first = std::clamp((window.begin - base.s) * rad_per_mm, 0.0, arc.turn);
  const double last = std::clamp((window.end - base.s) * rad_per_mm, first, arc.turn);
  const double here = std::clamp((s_ - base.s) * rad_per_mm, first, last);

  const double x = p[arc.a] - arc.segment.centre_mm[arc.a];
  const double y = p[arc.b] - arc.segment.centre_mm[arc.b];
  const double angle = std::atan2(arc.sense * (y * arc.cosine - x * arc.sine), x * arc.cosine + y * arc.sine);
  const double nearest_turn = angle + two_pi * std::floor((here - angle) / two_pi + 0.5);
  double u = nearest_turn;
  if (u < first) {
    u = std::abs(u + two_pi - last) < first - u ? last : first;
  } else if (u > last) {
    u = std::abs(u - two_pi - first) < u - last ? first : last;
  }

  const double rho2 = x * x + y * y;
  const bool flat_circle = arc.pitch == 0.0 && arc.radius_rate == 0.0;
  if (flat_circle && u == nearest_turn && rho2 > 0.0) {
    const double rho = std::sqrt(rho2);
    const double outward = (rho - arc.segment.start_radius_mm) / rho;
    Foot foot;
    foot.offset[arc.a] = outward * x;
    foot.offset[arc.b] = outward * y;
    foot.offset[arc.n] = p[arc.n] - arc.segment.start_mm[arc.n];
    foot.tangent[arc.a] = -arc.sense * y;
    foot.tangent[arc.b] = arc.sense * x;
    foot.distance2 = foot.offset.squaredNorm();
    foot.along = std::min(u / rad_per_mm, base.length);
    return foot;
  }
  if (!flat_circle) u = refined_foot(arc, p, {std::sqrt(rho2), angle}, {first, last}, u);
  Foot foot = arc_point_foot(arc, u, p);
  if (!flat_circle && last - first > widest_local_window_rad) {
    // So wide a window may hold several turns: ask the whole arc too.
    const Nearest whole = nearest_on(arc.segment, p);
    const double u_whole = whole.s_mm * rad_per_mm;
    if (u_whole >= first && u_whole <= last) {
      const Foot other = arc_point_foot(arc, u_whole, p);
      if (other.distance2 < foot.distance2 * (1.0 - 1e-6)) {
        foot = other;
        u = u_whole;
      }
    }
  }
  foot.along = u >= arc.turn ? base.length : std::min(u / rad_per_mm, base.length);
  return foot;
}

bool ContourTracker::is_beyond(std::size_t first, std::size_t size, const Vector3& p, double limit2) const noexcept {
  const double length = begin_mm(first + size) - begin_mm(first);
  const double nearest = (p - geometry_->path.start_mm(first)).norm() - length * (1.0 + group_slack) - group_slack_mm;
  return nearest > 0.0 && nearest * nearest >= limit2;
}

std::size_t ContourTracker::group_from(std::size_t first, const Vector3& p, double limit2) const noexcept {
  std::size_t passed = 0;
  for (std::size_t size = group_size; (first & (size - 1)) == 0 && first + size < segments(); size *= group_size) {
    if (!is_beyond(first, size, p, limit2)) break;
    passed = size;
  }
  return passed;
}

std::size_t ContourTracker::group_before(std::size_t end, const Vector3& p, double limit2) const noexcept {
  std::size_t passed = 0;
  for (std::size_t size = group_size; (end & (size - 1)) == 0 && end >= size && end < segments(); size *= group_size) {
    if (!is_beyond(end - size, size, p, limit2)) break;
    passed = size;
  }
  return passed;
}

ContourTracker::Found ContourTracker::search(const Vector3& p, double move, const Window& window,
                                             double bound) const noexcept {
  // What follows looks other segments up, which may take this one's slot: what is needed of it is read before.
  const NearSegment& here = at(cursor_);
  Found best{foot_on(here, p, window), cursor_, 0.0};
  best.s = here.s + best.foot.along;
  const double advance = best.s - s_;
  bool retreats = advance < 0.0;
  Window forward = window;
  // A filtered command turns back before it reaches the tip: the return leg lies as far behind the tip.
  const double to_tip = here.length - best.foot.along;
  if (advance < 0.5 * move && to_tip < longest_turn_mm) {
    forward.end = std::max(forward.end, std::min(here.s + here.length + to_tip + window_margin_mm, bound));
  }
  double next_s = here.next_s;
  if (next_s <= forward.end) {
    const Vector3 heading = here.arc < 0 ? here.direction : best.foot.tangent;
    for (std::size_t i = cursor_ + 1; i < segments() && next_s <= forward.end; ++i) {
      const double limit = retreats ? best.foot.distance2 * (1.0 + retreat_tie_relative) + retreat_tie_absolute_mm2
                                    : best.foot.distance2 * (1.0 - tie_relative) - tie_absolute_mm2;
      if (const std::size_t passed = i % group_size == 0 ? group_from(i, p, limit) : 0; passed > 0) {
        i += passed - 1;
        next_s = begin_mm(i + 1);
        continue;
      }
      const NearSegment& part = at(i);
      next_s = part.next_s;
      const Foot foot = foot_on(part, p, forward);
      if (foot.distance2 >= limit) continue;
      // A return leg runs back: another turn of a circle does not. Far ahead it is one only as far behind the tip as
      // the point was before it, and nearer: a vibration along the path is no reason to jump.
      const bool nearer = foot.distance2 < best.foot.distance2 * (1.0 - tie_relative) - tie_absolute_mm2;
      const bool back = (part.arc < 0 ? part.direction : foot.tangent).dot(heading) < 0.0;
      const bool within = part.s + foot.along <= window.end;
      if (within ? nearer || back : nearer && back && i == cursor_ + 1 && 2.0 * foot.along > to_tip) {
        best = {foot, i, part.s + foot.along};
        retreats = false;
      }
    }
  }
  for (std::size_t i = cursor_; i-- > 0;) {
    const NearSegment& part = at(i);
    if (part.s + part.length < window.begin) break;
    const double limit = best.foot.distance2 * (1.0 - tie_relative) - tie_absolute_mm2;
    if (const std::size_t passed = (i + 1) % group_size == 0 ? group_before(i + 1, p, limit) : 0; passed > 0) {
      i -= passed - 1;
      continue;
    }
    const Foot foot = foot_on(part, p, window);
    if (foot.distance2 < limit) best = {foot, i, part.s + foot.along};
  }
  return best;
}

bool ContourTracker::runs_along(std::size_t index) const noexcept {
  const Path& path = geometry_->path;
  if (!path.is_plain(index)) return false;
  const Vector3 along = path.start_mm(index + 1) - path.start_mm(index);
  const double forward = along.dot(straight_.direction);
  return forward > 0.0 && forward * forward >= straight_cosine2 * along.squaredNorm();
}

void ContourTracker::straighten() noexcept {
  const NearSegment& here = at(cursor_);
  const bool is_line = here.arc < 0 && here.length > 0.0;
  straight_ = {cursor_, here.direction, cursor_, cursor_, here.s, here.next_s, !is_line, !is_line};
}

// A section grows with the window as far as it runs straight; where it ends, one is begun about each new segment.
bool ContourTracker::runs_straight(const Window& window) noexcept {
  constexpr double infinite = std::numeric_limits<double>::infinity();
  if (straight_.about == no_segment) straighten();
  for (;;) {
    Straight& now = straight_;
    while (!now.turns_behind && (now.end <= window.end || now.last <= cursor_)) {
      if (now.last + 1 >= segments()) {
        now.end = infinite;
        break;
      }
      if (!runs_along(now.last + 1)) {
        now.turns_behind = true;
      } else {
        now.end = begin_mm(++now.last + 1);
      }
    }
    while (!now.turns_before && now.begin + group_slack_mm >= window.begin) {
      if (now.first == 0) {
        now.begin = -infinite;
      } else if (!runs_along(now.first - 1)) {
        now.turns_before = true;
      } else {
        now.begin = begin_mm(--now.first);
      }
    }
    const bool reaches = now.end > window.end && now.begin + group_slack_mm < window.begin && cursor_ >= now.first &&
                         (cursor_ < now.last || now.end == infinite);
    if (reaches) near_ = {now.begin + group_slack_mm, now.end};
    if (reaches || now.about == cursor_) return reaches;
    straighten();
  }
}

// 1 left, -1 right; 0 where the deviation or the travel is along Z only.
double ContourTracker::lateral_side(const Found& found, double distance) const noexcept {
  const NearSegment& part = at(found.index);  // its neighbours have other slots
  const double from_start = found.foot.along;
  Vector3 travel = part.arc < 0 ? part.direction : found.foot.tangent;
  // At a corner one leg alone may see the point on the wrong side: the mean direction decides.
  if (from_start <= 0.0 && found.index > 0) {
    travel = start_tangent(found.index) + end_tangent(found.index - 1);
  } else if (from_start >= part.length && found.index + 1 < segments()) {
    travel = end_tangent(found.index) + start_tangent(found.index + 1);
  }
  const Vector3& offset = found.foot.offset;
  const double travel_xy2 = travel[0] * travel[0] + travel[1] * travel[1];
  const double lateral = travel[0] * offset[1] - travel[1] * offset[0];
  const double negligible = negligible_share * distance;
  const bool has_side = travel_xy2 > negligible_share * negligible_share * travel.squaredNorm() &&
                        lateral * lateral > negligible * negligible * travel_xy2;
  if (!has_side) return 0.0;
  return lateral < 0.0 ? -1.0 : 1.0;
}

PathSide ContourTracker::side() const noexcept {
  // As much along Z as across it is the border.
  if (2.0 * height_ * height_ > deviation_ * deviation_) return height_ > 0.0 ? PathSide::above : PathSide::below;
  if (lateral_ == 0.0) return PathSide::none;
  return lateral_ > 0.0 ? PathSide::left : PathSide::right;
}

double ContourTracker::step(const Vector3& p) noexcept {
  return follow(p, [] { return std::numeric_limits<double>::infinity(); });
}

double ContourTracker::step(const Vector3& p, const ContourTracker& driver) noexcept {
  return follow(p, [&] { return driver.s_ + 2.0 * (p - driver.last_).norm() + reach_mm; });
}

// Most points lie beside the middle of a segment, or of the next one, of a path that runs straight about them, and then
// no other segment needs a look: all points within so straight a section that lie `t` of path away from the foot, of
// which `rest` on the foot's own segment, are further off, since t^2 cos^2 - 2 |offset| (t - rest) sin > 0.
template <typename Bound>
inline double ContourTracker::follow(const Vector3& p, const Bound& bound) noexcept {
  // The sum of the components' sizes bounds the step's length without a square root.
  const double move = (p - last_).lpNorm<1>();
  if (!std::isfinite(move)) return std::numeric_limits<double>::quiet_NaN();
  const double retreat = furthest_ - s_;
  const double behind = move + deviation_ + window_margin_mm;
  const double ahead = 2.0 * move + 4.0 * (deviation_ + retreat) + window_margin_mm + retreat;
  const Window window{s_ - behind, s_ + ahead};
  // What was passed before stays in reach, whatever the caller knows.
  const auto furthest = [&] { return std::max(bound(), s_); };
  const bool is_near = window.begin > near_.begin && window.end < near_.end;
  if (!is_near && !runs_straight(window)) return follow_any(p, move, window, furthest());

  std::size_t i = cursor_;
  const NearSegment* part = &at(i);
  Vector3 from_start = p - part->start;
  double along = from_start.dot(part->direction);
  if (along > part->length && i + 1 < segments()) {
    part = &at(++i);
    from_start = p - part->start;
    along = from_start.dot(part->direction);
    if (!(part->s + along <= std::min(window.end, furthest()))) return follow_any(p, move, window, furthest());
  }
  const Vector3 offset = from_start - along * part->direction;
  const double distance = std::sqrt(offset.squaredNorm());
  const double margin = nearest_share * distance + nearest_margin_mm;
  const double rest = part->length - along;
  const bool nearest =
      along >= 0.0 && rest >= 0.0 && (along >= margin || i == 0) && (rest >= margin || i + 1 == segments());
  const bool grows = distance > deviation_ + 0.25 * move && move > 0.0;
  if (!nearest || (grows && growing_ + 1 >= growing_until_lost)) return follow_any(p, move, window, furthest());

  growing_ = grows ? growing_ + 1 : 0;
  if (i != cursor_) {
    cursor_ = i;
    // The next segment must run straight too, where there is one.
    if (i >= straight_.last && std::isfinite(straight_.end)) near_.begin = std::numeric_limits<double>::infinity();
  }
  s_ = part->s + along;
  furthest_ = std::clamp(furthest_, s_, s_ + longest_retreat_mm);
  deviation_ = distance;
  last_ = p;
  height_ = offset[2];
  const double lateral = part->direction[0] * offset[1] - part->direction[1] * offset[0];
  const double negligible = negligible_share * distance;
  const bool has_side = part->has_side && lateral * lateral > negligible * negligible * part->across2;
  if (!has_side) {
    lateral_ = 0.0;
    return height_ < 0.0 ? -distance : distance;
  }
  lateral_ = lateral < 0.0 ? -1.0 : 1.0;
  return lateral_ * distance;
}

double ContourTracker::follow_any(const Vector3& p, double move, const Window& within, double bound) noexcept {
  const Window window{within.begin, std::min(within.end, bound)};
  Found found = search(p, move, window, bound);
  double distance = std::sqrt(found.foot.distance2);
  bool jumped = false;

  growing_ = distance > deviation_ + 0.25 * move && move > 0.0 ? growing_ + 1 : 0;
  if (growing_ >= growing_until_lost && (growing_ & (growing_ - 1)) == 0) {
    // Widened at 8, 16, 32 … samples only: the cost stays proportional to the samples.
    const double factor = static_cast<double>(growing_) * static_cast<double>(growing_) / 16.0;
    const double behind = s_ - within.begin;
    const double ahead = within.end - s_;
    const Found wide = search(p, move, {s_ - factor * behind, std::min(s_ + factor * ahead, bound)}, bound);
    // An overshoot beside another pass is not a lost track: only a much nearer foot is worth the jump.
    if (wide.foot.distance2 < 0.25 * found.foot.distance2) {
      found = wide;
      distance = std::sqrt(found.foot.distance2);
      jumped = true;
      growing_ = 0;
    }
  }

  if (cursor_ != found.index) near_.begin = std::numeric_limits<double>::infinity();
  cursor_ = found.index;
  s_ = found.s;
  furthest_ = jumped ? s_ : std::clamp(furthest_, s_, s_ + longest_retreat_mm);
  deviation_ = distance;
  last_ = p;
  height_ = found.foot.offset[2];
  lateral_ = distance == 0.0 ? 0.0 : lateral_side(found, distance);
  if (lateral_ != 0.0) return lateral_ * distance;
  return height_ < 0.0 ? -distance : distance;
}

}  // namespace shapegcode
