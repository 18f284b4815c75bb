#include "shapegcode/path.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <string>
#include <utility>

#include "base/refuse.hpp"
#include "path/arc_end.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

bool same(double a, double b) noexcept { return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b); }

bool same(const Vector3& a, const Vector3& b) noexcept {
  return same(a[0], b[0]) && same(a[1], b[1]) && same(a[2], b[2]);
}

// Whether a segment equals `make_line` of its ends, to the bit, and ends where the next one starts.
bool is_plain(const Segment& segment, const Vector3& next_mm) noexcept {
  const Segment line = make_line(segment.start_mm, next_mm, segment.feed_mm_per_s, segment.line);
  return segment.kind == line.kind && same(segment.end_mm, next_mm) && same(segment.length_mm, line.length_mm) &&
         segment.normal == line.normal && segment.stop_at_end == line.stop_at_end &&
         same(segment.centre_mm, line.centre_mm) && same(segment.start_radius_mm, 0.0) &&
         same(segment.end_radius_mm, 0.0) && same(segment.start_angle_rad, 0.0) && same(segment.sweep_rad, 0.0);
}

}  // namespace

Path::Path(const Segments& segments) {
  PathBuilder builder;
  for (std::size_t i = 0; i < segments.size(); ++i) builder.add(segments[i]);
  *this = builder.path();
}

void PathBuilder::add(const Segment& segment) {
  if (!std::isfinite(segment.length_mm) || !segment.start_mm.allFinite() || !segment.end_mm.allFinite()) {
    throw Error(ErrorKind::argument, detail::message("path segment {} has a coordinate that is not finite", size_),
                segment.line);
  }
  if (size_ > 0) {
    const double gap = (segment.start_mm - last_.end_mm).norm();
    if (gap > largest_gap_mm) {
      throw Error(ErrorKind::argument,
                  detail::message("path segment {} starts {:.3g} mm from the end of its predecessor (limit {} mm)",
                                  size_, gap, largest_gap_mm),
                  segment.line);
    }
    put(segment.start_mm);
  }
  last_ = segment;
  ++size_;
}

void PathBuilder::put(const Vector3& next_mm) {
  Path::Data& data = *data_;
  const std::uint32_t line = last_.line - static_cast<std::uint32_t>(data.feeds.size());
  std::uint32_t kept = 0;
  if (!is_plain(last_, next_mm)) {
    data.kept.push_back(last_);
    kept = static_cast<std::uint32_t>(data.kept.size());
  }
  data.nodes.push_back({last_.start_mm, distance_mm_});
  data.feeds.push_back(last_.feed_mm_per_s);
  data.sources.push_back({line, kept});
  distance_mm_ += last_.length_mm;
}

Path PathBuilder::path() {
  if (size_ > 0) put(last_.end_mm);
  data_->nodes.push_back({last_.end_mm, distance_mm_});
  data_->nodes.fit();
  data_->kept.shrink_to_fit();
  Path path;
  path.data_ = std::move(data_);
  *this = PathBuilder();
  return path;
}

std::size_t Path::segment_at(double s_mm) const noexcept {
  std::size_t first = 0;
  std::size_t behind = size();
  while (first + 1 < behind) {
    const std::size_t middle = first + (behind - first) / 2;
    (distance_mm(middle) <= s_mm ? first : behind) = middle;
  }
  return first;
}

void Path::seek(double s_mm, std::size_t& cursor) const noexcept {
  cursor = std::min(cursor, size() - 1);
  while (cursor > 0 && s_mm < distance_mm(cursor)) {
    --cursor;
  }
  while (cursor + 1 < size() && s_mm >= distance_mm(cursor + 1)) {
    ++cursor;
  }
}

bool Path::moves_as(const Path& other) const noexcept {
  if (data_ == other.data_) return true;
  if (size() != other.size()) return false;
  for (std::size_t i = 0; i < size(); ++i) {
    if (is_plain(i) && other.is_plain(i)) {
      if (start_mm(i) != other.start_mm(i) || end_mm(i) != other.end_mm(i) ||
          feed_mm_per_s(i) != other.feed_mm_per_s(i)) {
        return false;
      }
      continue;
    }
    const Segment a = (*this)[i];
    const Segment b = other[i];
    if (a.kind != b.kind || a.start_mm != b.start_mm || a.end_mm != b.end_mm || a.feed_mm_per_s != b.feed_mm_per_s ||
        a.centre_mm != b.centre_mm || a.sweep_rad != b.sweep_rad || a.normal != b.normal ||
        a.stop_at_end != b.stop_at_end) {
      return false;
    }
  }
  return true;
}

Vector3 Path::point(double s_mm, std::size_t& cursor) const noexcept {
  if (size() == 0) {
    return Vector3::Zero();
  }
  seek(s_mm, cursor);
  return point_at((*this)[cursor], s_mm - distance_mm(cursor));
}

}  // namespace shapegcode
