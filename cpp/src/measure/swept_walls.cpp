#include "shapegcode/measure/sections.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/refuse.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

using Eigen::Vector2d;

constexpr double infinite = std::numeric_limits<double>::infinity();
constexpr double no_wall = std::numeric_limits<double>::quiet_NaN();
// The programmed path is swept in chords within this distance of an arc.
constexpr double chord_error_mm = 1e-5;
constexpr double min_chord_mm = 1e-6;  // also where a spiral ends in its centre
constexpr double max_discs = 1e8;      // tool radii along the path
// How far a disc reaches depends on the largest deviation; so far it may have been less than it will be.
constexpr double min_deviation_mm = 0.01;
constexpr double growth = 2.0;
// Where the programmed wall lies further out than the tool's radius by more than this share, another leg made it.
constexpr double overlap_share = 1e-3;
constexpr double min_horizontal = 1e-6;

Vector2d horizontal(const Vector3& p) noexcept { return p.head<2>(); }

}  // namespace

SweptWalls::Station SweptWalls::station_at(const Path& path, double s, std::size_t& cursor) {
  Station station{s, Vector2d::Zero(), Vector2d::Zero(), -infinite, infinite};
  station.point = horizontal(path.point(s, cursor));
  const Vector2d along = horizontal(tangent_at(path[cursor], s - path.distance_mm(cursor)));
  if (along.norm() > min_horizontal) station.normal = Vector2d(-along.y(), along.x()).normalized();
  return station;
}

SweptWalls::SweptWalls(const Path& path, const std::vector<PathSection>& sections, double tool_radius_mm,
                       double spacing_mm, std::size_t max_stations)
    : radius_(tool_radius_mm) {
  if (!(tool_radius_mm > 0.0 && std::isfinite(tool_radius_mm) && spacing_mm > 0.0 && std::isfinite(spacing_mm))) {
    refuse("tool radius {} mm and station spacing {} mm must be > 0", tool_radius_mm, spacing_mm);
  }
  if (path.length_mm() / tool_radius_mm > max_discs) {
    refuse("tool radius {} mm on a path of {} mm: {:g} radii, limit {:g}", tool_radius_mm, path.length_mm(),
           path.length_mm() / tool_radius_mm, max_discs);
  }
  double length = 0.0;
  for (const PathSection& section : sections) length += section.length_mm();
  deviation_ = min_deviation_mm;
  min_fall_ = 1.0 / radius_;
  spacing_ = std::max(spacing_mm, length / static_cast<double>(std::max<std::size_t>(1, max_stations)));
  std::size_t cursor = 0;
  for (const PathSection& section : sections) {
    first_of_.push_back(stations_.size());
    const auto count = static_cast<std::size_t>(std::ceil(section.length_mm() / spacing_ * (1.0 - 1e-12)));
    const double spacing = count > 0 ? section.length_mm() / static_cast<double>(count) : 0.0;
    spacing_of_.push_back(spacing);
    for (std::size_t i = 0; i < count; ++i) {
      stations_.push_back(station_at(path, section.begin_mm + (static_cast<double>(i) + 0.5) * spacing, cursor));
    }
  }
  first_of_.push_back(stations_.size());
  take_reference(path);
}

void SweptWalls::take_reference(const Path& path) {
  for (std::size_t i = 0; i < path.size() && !stations_.empty(); ++i) {
    const Segment& segment = path[i];
    double step = segment.length_mm;
    if (segment.kind == SegmentKind::arc) {
      const double narrowest = std::min(segment.start_radius_mm, segment.end_radius_mm);
      step = std::min(step, std::max(std::sqrt(8.0 * narrowest * chord_error_mm), min_chord_mm));
    }
    const double pieces = std::max(1.0, std::ceil(segment.length_mm / std::min(step, radius_)));
    for (double k = 0.0; k < pieces; ++k) {
      const double from = segment.length_mm * k / pieces;
      const double to = segment.length_mm * (k + 1.0) / pieces;
      sweep_within(point_at(segment, from), point_at(segment, to), path.distance_mm(i) + from, path.distance_mm(i) + to,
                   radius_);
    }
    // Inside of an arc of radius R a neighbouring disc falls back by w^2 (1/r - 1/R) / 2 at a distance w: less than on
    // a line.
    if (segment.kind == SegmentKind::arc) {
      const double narrowest = std::min(segment.start_radius_mm, segment.end_radius_mm);
      if (narrowest > radius_) min_fall_ = std::min(min_fall_, 1.0 / radius_ - 1.0 / narrowest);
    }
  }
  // The disc at the station itself cuts one radius; chords are a little inside of an arc.
  for (Station& station : stations_) {
    station.left = std::max(station.left, radius_);
    station.right = std::min(station.right, -radius_);
  }
  const double limit = radius_ * (1.0 + overlap_share) + chord_error_mm;
  reference_.reserve(stations_.size());
  for (Station& station : stations_) {
    reference_.push_back(
        {station.left <= limit ? station.left : no_wall, station.right >= -limit ? station.right : no_wall});
    station.left = -infinite;
    station.right = infinite;
  }
}

void SweptWalls::sweep(const Vector3& from, const Vector3& to, double from_foot_mm, double to_foot_mm,
                       double deviation_mm) noexcept {
  deviation_ = std::max(deviation_, std::abs(deviation_mm));
  // Two discs whose centres deviate by at most d each: one at a distance w reaches beyond the other only where
  // w^2 / 2 times the fall is below 2 d.
  const double reach = std::sqrt(4.0 * growth * deviation_ / min_fall_) + overlap_share * radius_ + spacing_;
  sweep_within(from, to, from_foot_mm, to_foot_mm, std::min(reach, radius_));
}

void SweptWalls::sweep_within(const Vector3& from, const Vector3& to, double from_foot_mm, double to_foot_mm,
                              double reach_mm) noexcept {
  const double begin = std::min(from_foot_mm, to_foot_mm) - reach_mm;
  const double end = std::max(from_foot_mm, to_foot_mm) + reach_mm;
  const double radius2 = radius_ * radius_;
  const double fall = 0.5 / radius_;
  const Vector2d a = horizontal(from);
  const Vector2d b = horizontal(to);
  const double length = (b - a).norm();
  auto station = std::lower_bound(stations_.begin(), stations_.end(), begin,
                                  [](const Station& each, double s) { return each.s < s; });
  for (; station != stations_.end() && station->s <= end; ++station) {
    // In the station's frame: u along the path, v to the left. The normal is u = 0.
    const Vector2d& n = station->normal;
    const Vector2d pa = a - station->point;
    const Vector2d pb = b - station->point;
    const double va = pa.dot(n);
    const double vb = pb.dot(n);
    const double ua = pa.x() * n.y() - pa.y() * n.x();
    const double ub = pb.x() * n.y() - pb.y() * n.x();
    // A disc at u reaches to sqrt(r^2 - u^2) < r - u^2 / (2 r): most have nothing to add.
    const double nearest = ua * ub <= 0.0 ? 0.0 : std::min(std::abs(ua), std::abs(ub));
    const double most = radius_ - nearest * nearest * fall;
    if (std::max(va, vb) + most <= station->left && std::min(va, vb) - most >= station->right) continue;
    if (nearest > radius_ || n.isZero(0.0)) continue;
    const auto widen = [&station](double low, double high) {
      station->left = std::max(station->left, high);
      station->right = std::min(station->right, low);
    };
    // The discs at both ends, and between them the straight edges of what the disc sweeps.
    if (const double rest = radius2 - ua * ua; rest >= 0.0) widen(va - std::sqrt(rest), va + std::sqrt(rest));
    if (const double rest = radius2 - ub * ub; rest >= 0.0) widen(vb - std::sqrt(rest), vb + std::sqrt(rest));
    const double du = ub - ua;
    if (du == 0.0) continue;
    const double dv = vb - va;
    const double across = std::copysign(1.0, du) * radius_ * dv / length;
    const double half_width = radius_ * std::abs(du) / length;
    const double upper = (across - ua) / du;
    const double lower = (-across - ua) / du;
    if (upper >= 0.0 && upper <= 1.0) station->left = std::max(station->left, va + upper * dv + half_width);
    if (lower >= 0.0 && lower <= 1.0) station->right = std::min(station->right, va + lower * dv - half_width);
  }
}

SweptWalls::Profile SweptWalls::profile(std::size_t section) const {
  Profile profile;
  profile.spacing_mm = spacing_of_[section];
  for (std::size_t i = first_of_[section]; i < first_of_[section + 1]; ++i) {
    if (i == first_of_[section]) profile.first_mm = stations_[i].s;
    profile.point.push_back(stations_[i].point);
    profile.normal.push_back(stations_[i].normal);
    const bool cut = stations_[i].left > stations_[i].right;
    profile.left.push_back(cut ? stations_[i].left - reference_[i].left : no_wall);
    profile.right.push_back(cut ? stations_[i].right - reference_[i].right : no_wall);
  }
  return profile;
}

}  // namespace shapegcode
