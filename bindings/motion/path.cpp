#include <pybind11/stl.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <string>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/path.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

constexpr double arc_step_rad = 0.05;

// Points along the path for pictures: segment ends, arcs in steps of `step_rad`.
template <typename Take>
void for_each_point(const Path& path, double step_rad, Take take) {
  if (!(step_rad > 0.0)) {
    throw Error(ErrorKind::argument, "step_rad is " + std::to_string(step_rad) + ", must be > 0");
  }
  constexpr double max_pieces = 1e7;
  if (path.size() > 0) take(path.start_mm(0));
  for (std::size_t k = 0; k < path.size(); ++k) {
    if (!path.is_arc(k)) {
      take(path.end_mm(k));
      continue;
    }
    const Segment segment = path[k];
    const double steps = std::ceil(std::abs(segment.sweep_rad) / step_rad);
    if (!(steps <= max_pieces)) {
      throw Error(ErrorKind::argument, "an arc in steps of step_rad takes more than 10000000 points");
    }
    const int pieces = std::max(1, static_cast<int>(steps));
    for (int i = 1; i <= pieces; ++i) {
      take(point_at(segment, segment.length_mm * i / pieces));
    }
  }
}

py::array polyline(const Path& path, double step_rad) {
  std::vector<Vector3> points;
  for_each_point(path, step_rad, [&](const Vector3& point) { points.push_back(point); });
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(points.size()), axis_count);
  for (std::size_t i = 0; i < points.size(); ++i) {
    matrix.row(static_cast<Eigen::Index>(i)) = points[i];
  }
  return take(std::move(matrix));
}

// Size of the box around the points of its polyline.
Vector3 extent(const Path& path) {
  Eigen::AlignedBox3d box;
  for_each_point(path, arc_step_rad, [&](const Vector3& point) { box.extend(point); });
  return box.isEmpty() ? Vector3(Vector3::Zero()) : Vector3(box.sizes());
}

// One number per segment.
template <typename Value>
auto of_segments(const Path& path, Value value) {
  using Number = decltype(value(std::size_t{0}));
  py::array_t<Number> column(static_cast<py::ssize_t>(path.size()));
  for (std::size_t i = 0; i < path.size(); ++i) {
    column.mutable_data()[i] = value(i);
  }
  return column;
}

}  // namespace

void register_path(py::module_& module) {
  py::enum_<SegmentKind>(module, "SegmentKind", "Kind of a canonical move.")
      .value("rapid", SegmentKind::rapid)
      .value("line", SegmentKind::line)
      .value("arc", SegmentKind::arc);

  py::class_<Segment>(module, "Segment", "One canonical move in mm.")
      .def_static(
          "line", [](const Vector3& start, const Vector3& end, double feed) { return make_line(start, end, feed); },
          py::arg("start_mm"), py::arg("end_mm"), py::arg("feed_mm_per_s"), "A straight move.")
      .def_static(
          "arc",
          [](const Vector3& start, const Vector3& end, const Vector3& centre, double sweep, double feed, int normal) {
            if (normal < 0 || normal > 2) {
              throw Error(ErrorKind::argument, "normal is " + std::to_string(normal) + ", must be 0, 1 or 2");
            }
            return make_arc(start, end, centre, sweep, normal, feed);
          },
          py::arg("start_mm"), py::arg("end_mm"), py::arg("centre_mm"), py::arg("sweep_rad"), py::arg("feed_mm_per_s"),
          py::arg("normal") = 2,
          "An arc or helix about the axis `normal` (0 X, 1 Y, 2 Z); `sweep_rad` > 0 turns counter-clockwise seen from "
          "the positive end of this axis. Raises ArgumentError on a zero radius or sweep.")
      .def_readonly("start_mm", &Segment::start_mm, "Start, shape (3,), mm.")
      .def_readonly("end_mm", &Segment::end_mm, "End, shape (3,), mm.")
      .def_readonly("centre_mm", &Segment::centre_mm, "Centre of an arc, shape (3,), mm.")
      .def_readonly("radius_mm", &Segment::start_radius_mm, "Radius of an arc at its start, mm.")
      .def_readonly("sweep_rad", &Segment::sweep_rad, "Signed sweep of an arc, rad.")
      .def_readonly("length_mm", &Segment::length_mm, "Length, mm.")
      .def_readonly("feed_mm_per_s", &Segment::feed_mm_per_s, "Programmed feed, mm/s; 0 for a rapid.")
      .def_readonly("line_number", &Segment::line, "Source line, from 1; 0 if there is none.")
      .def_readonly("kind", &Segment::kind, "Kind of the move.")
      .def_readonly("normal", &Segment::normal, "Axis perpendicular to the plane of an arc: 0 X, 1 Y, 2 Z.")
      .def(
          "point_at", [](const Segment& self, double s) { return point_at(self, s); }, py::arg("s_mm"),
          "Position at a distance from the start, shape (3,), mm.")
      .def(
          "chords_within",
          [](const Segment& self, double tolerance_mm) {
            if (!(tolerance_mm > 0.0)) {
              throw Error(ErrorKind::argument, "tolerance of chords " + std::to_string(tolerance_mm) + " mm: above 0");
            }
            return chords_within(self, tolerance_mm);
          },
          py::arg("tolerance_mm"),
          "Number of equal chords that approximate an arc within a tolerance; 1 for a line.\n\nRaises ArgumentError if "
          "the tolerance is not above 0.");

  py::class_<Path, std::shared_ptr<Path>>(module, "Path", "A connected sequence of segments.")
      .def(py::init<std::vector<Segment>>(), py::arg("segments"),
           "Raises ArgumentError if a segment does not start where its predecessor ends (1e-6 mm).")
      .def("__len__", &Path::size)
      .def(
          "__getitem__",
          [](const Path& self, py::ssize_t i) {
            const auto n = static_cast<py::ssize_t>(self.size());
            if (i < 0) {
              i += n;
            }
            if (i < 0 || i >= n) {
              throw py::index_error("segment index out of range");
            }
            return self[static_cast<std::size_t>(i)];
          },
          py::arg("index"), "Segment at an index.")
      .def("moves_as", &Path::moves_as, py::arg("other"),
           "Whether the motion is the same: geometry, feeds and stops, regardless of line numbers.")
      .def_property_readonly("length_mm", &Path::length_mm, "Whole length, mm.")
      .def_property_readonly(
          "start_mm", [](const Path& self) { return self.size() > 0 ? self.start_mm(0) : Vector3(Vector3::Zero()); },
          "Start, shape (3,), mm.")
      .def_property_readonly(
          "end_mm",
          [](const Path& self) { return self.size() > 0 ? self.end_mm(self.size() - 1) : Vector3(Vector3::Zero()); },
          "End, shape (3,), mm.")
      .def_property_readonly(
          "slowest_feed_mm_per_s",
          [](const Path& self) {
            double slowest = std::numeric_limits<double>::infinity();
            for (std::size_t i = 0; i < self.size(); ++i) slowest = std::min(slowest, self.feed_mm_per_s(i));
            return slowest;
          },
          "Smallest programmed feed, mm/s: 0 with a rapid, infinity for an empty path.")
      .def_property_readonly(
          "programmed_time_s",
          [](const Path& self) {
            double time = 0.0;
            for (const Segment& segment : self.segments()) {
              time += segment.length_mm > 0.0 ? segment.length_mm / segment.feed_mm_per_s : 0.0;
            }
            return time;
          },
          "Time at the programmed feeds without any acceleration, s; infinity with a rapid.")
      .def_property_readonly(
          "fastest_feed_mm_per_s",
          [](const Path& self) {
            double fastest = 0.0;
            for (std::size_t i = 0; i < self.size(); ++i) fastest = std::max(fastest, self.feed_mm_per_s(i));
            return fastest;
          },
          "Largest programmed feed, mm/s; 0 for an empty path.")
      .def_property_readonly(
          "largest_sweep_rad",
          [](const Path& self) {
            double largest = 0.0;
            for (const Segment& segment : self.segments()) {
              largest = std::max(largest, std::abs(segment.sweep_rad));
            }
            return largest;
          },
          "Largest sweep of any arc, rad; 0 without arcs.")
      .def_property_readonly(
          "segment_ends_mm",
          [](const Path& self) { return of_segments(self, [&](std::size_t i) { return self.distance_mm(i + 1); }); },
          "Distance of each segment's end from the start, (n,), mm.")
      .def_property_readonly(
          "segment_feeds_mm_per_s",
          [](const Path& self) { return of_segments(self, [&](std::size_t i) { return self.feed_mm_per_s(i); }); },
          "Programmed feed of each segment, (n,), mm/s.")
      .def_property_readonly(
          "segment_lines",
          [](const Path& self) { return of_segments(self, [&](std::size_t i) { return self.line(i); }); },
          "Source line of each segment, (n,), from 1; 0 if there is none.")
      .def_property_readonly(
          "arcs_in_xy",
          [](const Path& self) {
            const Segments segments = self.segments();
            return std::all_of(segments.begin(), segments.end(), [](const Segment& segment) {
              return segment.kind != SegmentKind::arc || segment.normal == 2;
            });
          },
          "Whether every arc lies in the XY plane (G17).")
      .def_property_readonly("extent_mm", &extent, "Size of the box around it, shape (3,), mm; arcs as in `polyline`.")
      .def("polyline", &polyline, py::arg("step_rad") = arc_step_rad,
           "Points along the path, (n, 3), mm: its start, segment ends, arcs in steps of at most `step_rad`.");
}

}  // namespace shapegcode::bindings
