#include "shapegcode/path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "path/arc_end.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr std::size_t few_segments = 512;

}  // namespace

Path::Path(std::vector<Segment> segments) : segments_(std::move(segments)) {
  // A vector that grew holds room for as many again. Of a large one that room was never touched, and so is no memory.
  if (segments_.size() < few_segments) {
    segments_.shrink_to_fit();
  }
  distance_mm_.reserve(segments_.size() + 1);
  double distance = 0.0;
  distance_mm_.push_back(distance);
  for (std::size_t i = 0; i < segments_.size(); ++i) {
    const Segment& segment = segments_[i];
    if (!std::isfinite(segment.length_mm) || !segment.start_mm.allFinite() || !segment.end_mm.allFinite()) {
      throw Error(ErrorKind::argument, fmt::format("path segment {} has a coordinate that is not finite", i),
                  segment.line);
    }
    if (i > 0) {
      const double gap = (segment.start_mm - segments_[i - 1].end_mm).norm();
      if (gap > largest_gap_mm) {
        throw Error(ErrorKind::argument,
                    fmt::format("path segment {} starts {:.3g} mm from the end of its predecessor (limit {} mm)", i,
                                gap, largest_gap_mm),
                    segment.line);
      }
    }
    distance += segment.length_mm;
    distance_mm_.push_back(distance);
  }
}

Vector3 Path::point(double s_mm, std::size_t& cursor) const noexcept {
  if (segments_.empty()) {
    return Vector3::Zero();
  }
  cursor = std::min(cursor, segments_.size() - 1);
  while (cursor > 0 && s_mm < distance_mm_[cursor]) {
    --cursor;
  }
  while (cursor + 1 < segments_.size() && s_mm >= distance_mm_[cursor + 1]) {
    ++cursor;
  }
  return point_at(segments_[cursor], s_mm - distance_mm_[cursor]);
}

}  // namespace shapegcode
