#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "shapegcode/columns.hpp"
#include "shapegcode/samples.hpp"

namespace shapegcode {

enum class SegmentKind : std::uint8_t { rapid, line, arc };

/// One canonical move in mm. An arc turns about the axis `normal` (0 = X, 1 = Y, 2 = Z) and may climb along it; if
/// start and end radius differ within the controller's tolerance, the radius changes linearly over the sweep.
struct Segment {
  Vector3 start_mm = Vector3::Zero();
  Vector3 end_mm = Vector3::Zero();
  Vector3 centre_mm = Vector3::Zero();  ///< arc only; its component along `normal` is not used
  double start_radius_mm = 0.0;         ///< arc only
  double end_radius_mm = 0.0;           ///< arc only
  double start_angle_rad = 0.0;         ///< arc only, in the plane's own axes (normal+1, normal+2)
  double sweep_rad = 0.0;               ///< arc only, signed: positive turns normal+1 towards normal+2
  double length_mm = 0.0;
  double feed_mm_per_s = 0.0;  ///< programmed tangential feed; 0 for a rapid
  std::uint32_t line = 0;      ///< source line, from 1
  SegmentKind kind = SegmentKind::line;
  std::uint8_t normal = 2;
  bool stop_at_end = false;  ///< exact stop (G09, G61) or forced stop
};

/// A straight move.
[[nodiscard]] inline Segment make_line(const Vector3& start, const Vector3& end, double feed_mm_per_s,
                                       std::uint32_t line = 0) {
  Segment segment;
  segment.start_mm = start;
  segment.end_mm = end;
  segment.length_mm = (end - start).norm();
  segment.feed_mm_per_s = feed_mm_per_s;
  segment.line = line;
  return segment;
}

/// An arc or helix about `centre`; `sweep_rad` signed (see Segment). Throws Error(argument) on a zero radius or sweep,
/// a number that is not finite, or no such axis.
[[nodiscard]] Segment make_arc(const Vector3& start, const Vector3& end, const Vector3& centre, double sweep_rad,
                               int normal, double feed_mm_per_s, std::uint32_t line = 0);

/// Position at distance `s_mm` from the segment's start, 0 <= s <= length.
[[nodiscard]] Vector3 point_at(const Segment& segment, double s_mm) noexcept;

/// Unit tangent at distance `s_mm`; zero vector for a segment without length.
[[nodiscard]] Vector3 tangent_at(const Segment& segment, double s_mm) noexcept;

/// Number of equal chords that approximate an arc within a tolerance; 1 for a line.
[[nodiscard]] double chords_within(const Segment& segment, double tolerance_mm) noexcept;

/// Curvature 1/mm: 0 for a line, R/(R^2+p^2) for a helix with pitch p mm/rad.
[[nodiscard]] double curvature(const Segment& segment) noexcept;

/// Second derivative of the position with respect to distance: towards the centre of an arc, zero on a line.
[[nodiscard]] Vector3 bend_at(const Segment& segment, double s_mm) noexcept;

/// Nearest point of a segment to `p`.
struct Nearest {
  double distance_mm = 0.0;
  double s_mm = 0.0;  ///< distance of the foot from the segment's start
};
[[nodiscard]] Nearest nearest_on(const Segment& segment, const Vector3& p) noexcept;

/// A sequence of segments of a path or an array, by value. An array passed by reference must outlive it; an array
/// passed as an rvalue or in braces is stored.
class Segments;

/// A connected sequence of segments with the distance of each from the start. Constant after construction; copies share
/// their data. A line is stored as its start, its distance and, where they change, feed and line number; its length is
/// computed on request. Arcs and other segments are stored in full.
class Path {
 public:
  Path() = default;
  /// Throws Error(argument) if a segment does not start where its predecessor ends (1e-6 mm) or a number is not finite.
  explicit Path(const Segments& segments);

  [[nodiscard]] Segments segments() const noexcept;
  [[nodiscard]] std::size_t size() const noexcept { return data_ ? data_->feeds.size() : 0; }
  [[nodiscard]] Segment operator[](std::size_t i) const noexcept;
  /// Distance of segment i's start from the path's start; `distance_mm(size())` is the whole length.
  [[nodiscard]] double distance_mm(std::size_t i) const noexcept { return data_->nodes[i].distance_mm; }
  [[nodiscard]] double length_mm() const noexcept { return size() == 0 ? 0.0 : distance_mm(size()); }
  // Single values of segment i.
  [[nodiscard]] const Vector3& start_mm(std::size_t i) const noexcept { return data_->nodes[i].start_mm; }
  [[nodiscard]] const Vector3& end_mm(std::size_t i) const noexcept;
  [[nodiscard]] double feed_mm_per_s(std::size_t i) const noexcept { return data_->feeds[i]; }
  [[nodiscard]] std::uint32_t line(std::size_t i) const noexcept;
  [[nodiscard]] bool is_arc(std::size_t i) const noexcept;
  /// Whether it is a line that ends where the next one starts.
  [[nodiscard]] bool is_plain(std::size_t i) const noexcept { return data_->sources[i].kept == 0; }

  /// Whether the motion is the same: geometry, feeds and stops, regardless of line numbers.
  [[nodiscard]] bool moves_as(const Path& other) const noexcept;

  /// Position at `s_mm` from the start. `cursor` is the segment index of the previous call: amortised O(1) for
  /// monotonic `s_mm`, and real-time safe.
  [[nodiscard]] Vector3 point(double s_mm, std::size_t& cursor) const noexcept;
  /// Segment at `s_mm` from the start, without a cursor.
  [[nodiscard]] std::size_t segment_at(double s_mm) const noexcept;
  /// Moves `cursor` to the segment at `s_mm` from the start, one by one.
  void seek(double s_mm, std::size_t& cursor) const noexcept;

 private:
  friend class PathBuilder;

  struct Node {
    Vector3 start_mm;    // of a segment; the last one is the path's end
    double distance_mm;  // from the path's start
  };
  struct Source {
    std::uint32_t line;  // of the source, less the index of the segment
    std::uint32_t kept;  // 1 + index into `kept`; 0: a plain line

    friend bool operator==(const Source&, const Source&) = default;
  };
  struct Data {
    Column<Node> nodes;
    SteadyColumn<double> feeds;
    SteadyColumn<Source> sources;
    std::vector<Segment> kept;
  };

  std::shared_ptr<const Data> data_;
};

/// Builds a path segment by segment, without an array of segments.
class PathBuilder {
 public:
  /// Throws Error(argument) as `Path` does.
  void add(const Segment& segment);
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The path of the added segments; the builder is then empty.
  [[nodiscard]] Path path();

 private:
  void put(const Vector3& next_mm);

  std::shared_ptr<Path::Data> data_ = std::make_shared<Path::Data>();
  Segment last_;  // not yet stored: the start of the next one is not known
  std::size_t size_ = 0;
  double distance_mm_ = 0.0;  // of the start of `last_`
};

class Segments {
 public:
  using value_type = Segment;

  class Iterator {
   public:
    using iterator_category = std::input_iterator_tag;
    using value_type = Segment;
    using difference_type = std::ptrdiff_t;
    using pointer = const Segment*;
    using reference = Segment;

    Iterator(const Segments* of, std::size_t at) noexcept : of_(of), at_(at) {}
    Segment operator*() const noexcept { return (*of_)[at_]; }
    Iterator& operator++() noexcept {
      ++at_;
      return *this;
    }
    Iterator operator++(int) noexcept { return {of_, at_++}; }
    friend bool operator==(const Iterator& a, const Iterator& b) noexcept { return a.at_ == b.at_; }

   private:
    const Segments* of_;
    std::size_t at_;
  };

  // Functions of segments accept both. NOLINTBEGIN(google-explicit-constructor)
  Segments(Path path) noexcept : path_(std::move(path)), count_(path_.size()) {}
  Segments(std::span<const Segment> array) noexcept : array_(array.data()), count_(array.size()) {}
  Segments(const std::vector<Segment>& array) noexcept : Segments(std::span<const Segment>(array)) {}
  Segments(std::vector<Segment>&& array)
      : own_(std::make_shared<const std::vector<Segment>>(std::move(array))),
        array_(own_->data()),
        count_(own_->size()) {}
  Segments(std::initializer_list<Segment> array) : Segments(std::vector<Segment>(array)) {}
  // NOLINTEND(google-explicit-constructor)

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] Segment operator[](std::size_t i) const noexcept {
    return array_ == nullptr ? path_[first_ + i] : array_[first_ + i];
  }
  [[nodiscard]] Segment front() const noexcept { return (*this)[0]; }
  [[nodiscard]] Segment back() const noexcept { return (*this)[count_ - 1]; }
  [[nodiscard]] Iterator begin() const noexcept { return {this, 0}; }
  [[nodiscard]] Iterator end() const noexcept { return {this, count_}; }
  /// `count` segments from `first` on.
  [[nodiscard]] Segments part(std::size_t first, std::size_t count) const noexcept {
    Segments part = *this;
    part.first_ += first;
    part.count_ = count;
    return part;
  }

 private:
  Path path_;
  std::shared_ptr<const std::vector<Segment>> own_;
  const Segment* array_ = nullptr;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

inline Segments Path::segments() const noexcept { return *this; }

inline Segment Path::operator[](std::size_t i) const noexcept {
  const Source source = data_->sources[i];
  if (source.kept != 0) return data_->kept[source.kept - 1];
  Segment segment = make_line(start_mm(i), start_mm(i + 1), data_->feeds[i]);
  segment.line = source.line + static_cast<std::uint32_t>(i);
  return segment;
}

inline const Vector3& Path::end_mm(std::size_t i) const noexcept {
  const Source source = data_->sources[i];
  return source.kept == 0 ? start_mm(i + 1) : data_->kept[source.kept - 1].end_mm;
}

inline std::uint32_t Path::line(std::size_t i) const noexcept {
  return data_->sources[i].line + static_cast<std::uint32_t>(i);
}

inline bool Path::is_arc(std::size_t i) const noexcept {
  const Source source = data_->sources[i];
  return source.kept != 0 && data_->kept[source.kept - 1].kind == SegmentKind::arc;
}

}  // namespace shapegcode
