#include "shapegcode/measure/sections.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <optional>

#include "base/refuse.hpp"
#include "path/arc_frame.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

constexpr double same_direction_rad = 1e-4;
constexpr double same_circle_mm = 1e-3;

bool continues(const Segment& before, const Segment& next) {
  if ((before.kind == SegmentKind::arc) != (next.kind == SegmentKind::arc)) return false;
  if (next.kind != SegmentKind::arc) {
    const Vector3 a = tangent_at(before, 0.0);
    const Vector3 b = tangent_at(next, 0.0);
    return a.dot(b) > 0.0 && a.cross(b).norm() <= same_direction_rad;
  }
  const int a = ArcFrame(next.normal).a;
  const int b = ArcFrame(next.normal).b;
  return before.normal == next.normal && before.sweep_rad * next.sweep_rad > 0.0 &&
         std::abs(before.centre_mm[a] - next.centre_mm[a]) <= same_circle_mm &&
         std::abs(before.centre_mm[b] - next.centre_mm[b]) <= same_circle_mm &&
         std::abs(before.end_radius_mm - next.start_radius_mm) <= same_circle_mm;
}

PathSection section_of(const Path& path, std::size_t first, std::size_t last, SectionKind kind) {
  PathSection section;
  section.first = first;
  section.last = last;
  section.begin_mm = path.distance_mm(first);
  section.end_mm = path.distance_mm(last + 1);
  section.first_line = path[first].line;
  section.last_line = path[last].line;
  section.kind = kind;
  section.stops_at_end = path[last].stop_at_end || last + 1 == path.size();
  return section;
}

// The next segments from `first` on that can be measured as one line or one circle, including moves without length.
PathSection run_from(const Path& path, std::size_t first) {
  std::optional<std::size_t> shape;
  std::size_t last = first;
  for (std::size_t i = first; i < path.size(); ++i) {
    if (path[i].length_mm > 0.0) {
      if (shape && !continues(path[*shape], path[i])) break;
      shape = i;
    }
    last = i;
    if (path[i].stop_at_end) break;
  }
  const bool is_arc = shape && path[*shape].kind == SegmentKind::arc;
  return section_of(path, first, last, is_arc ? SectionKind::arc : SectionKind::line);
}

}  // namespace

std::vector<PathSection> path_sections(const Path& path, double short_mm) {
  if (!(std::isfinite(short_mm) && short_mm >= 0.0)) {
    refuse("short sections of {} mm: must be finite and >= 0", short_mm);
  }
  std::vector<PathSection> sections;
  bool last_is_short = false;
  for (std::size_t i = 0; i < path.size();) {
    const PathSection run = run_from(path, i);
    const bool is_short = run.length_mm() < short_mm;
    if (is_short && last_is_short && !sections.back().stops_at_end) {
      sections.back() = section_of(path, sections.back().first, run.last, SectionKind::curve);
    } else {
      sections.push_back(run);
    }
    last_is_short = is_short;
    i = run.last + 1;
  }
  return sections;
}

std::vector<PathSection> line_sections(const Path& path, std::span<const LineRange> ranges) {
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    if (ranges[i].first > ranges[i].last) {
      refuse("lines {} to {}: the first must not be behind the last", ranges[i].first, ranges[i].last);
    }
    for (std::size_t k = 0; k < i; ++k) {
      if (ranges[i].first <= ranges[k].last && ranges[k].first <= ranges[i].last) {
        refuse("lines {} to {} and {} to {} overlap", ranges[k].first, ranges[k].last, ranges[i].first, ranges[i].last);
      }
    }
  }
  const auto range_of = [&ranges](const Segment& segment) {
    std::size_t i = 0;
    while (i < ranges.size() && (segment.line < ranges[i].first || segment.line > ranges[i].last)) ++i;
    return i;
  };
  std::vector<PathSection> sections;
  for (std::size_t i = 0; i < path.size();) {
    const std::size_t range = range_of(path[i]);
    std::size_t last = i;
    while (last + 1 < path.size() && range_of(path[last + 1]) == range) ++last;
    if (range < ranges.size()) {
      const PathSection run = run_from(path, i);
      // What is one line or one circle as far as the range goes is measured as such.
      sections.push_back(section_of(path, i, last, run.last >= last ? run.kind : SectionKind::curve));
    }
    i = last + 1;
  }
  return sections;
}

}  // namespace shapegcode
