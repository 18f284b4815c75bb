#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "register.hpp"
#include "shapegcode/linear_feed.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_linear_feed(py::module_& module) {
  py::class_<LinearBlock>(module, "LinearBlock", "A block of linear feed that replaces blocks of constant feed.")
      .def(py::init([](const Vector3& end_mm, double length_mm, double start_feed, double feed, double radius_mm,
                       double sweep_rad) {
             return LinearBlock{.end_mm = end_mm,
                                .radius_mm = radius_mm,
                                .sweep_rad = sweep_rad,
                                .length_mm = length_mm,
                                .start_feed_mm_per_min = start_feed,
                                .feed_mm_per_min = feed};
           }),
           py::arg("end_mm"), py::arg("length_mm"), py::arg("start_feed_mm_per_min"), py::arg("feed_mm_per_min"),
           py::arg("radius_mm") = 0.0, py::arg("sweep_rad") = 0.0, "A line, or an arc in the XY plane.")
      .def_readonly("first", &LinearBlock::first, "Index of the first block that it replaces.")
      .def_readonly("last", &LinearBlock::last, "Index of the last one.")
      .def_readonly("end_mm", &LinearBlock::end_mm, "(3,) where it ends, mm.")
      .def_readonly("radius_mm", &LinearBlock::radius_mm, "Of an arc, mm; 0: a line.")
      .def_readonly("sweep_rad", &LinearBlock::sweep_rad, "Of an arc, rad.")
      .def_readonly("length_mm", &LinearBlock::length_mm, "Of its path, mm.")
      .def_readonly("start_feed_mm_per_min", &LinearBlock::start_feed_mm_per_min, "At its start, mm/min.")
      .def_readonly("feed_mm_per_min", &LinearBlock::feed_mm_per_min, "At its end, mm/min.")
      .def_readonly("sets_feed", &LinearBlock::sets_feed,
                    "Its start feed differs from the feed of the block before: a line before it sets the feed.")
      .def_readonly("is_linear", &LinearBlock::is_linear, "False: its feed is constant.")
      .def_property_readonly("duration_s", &LinearBlock::duration_s, "Duration, s.");

  module.def("linear_duration_s", &linear_duration_s, py::arg("length_mm"), py::arg("start_mm_per_s"),
             py::arg("end_mm_per_s"), "Time of a block whose speed is linear along its path, s.");
  module.def("linear_end_speed", &linear_end_speed, py::arg("length_mm"), py::arg("start_mm_per_s"), py::arg("time_s"),
             "Speed at one end of a block of a given duration from the speed at its other end, mm/s; None: there is no "
             "such speed.");
  module.def("linear_distance_mm", &linear_distance_mm, py::arg("length_mm"), py::arg("start_mm_per_s"),
             py::arg("end_mm_per_s"), py::arg("time_s"),
             "Distance along a block whose speed is linear along its path, at a time since its start, mm.");
  module.def(
      "linear_positions_mm",
      [](const Vector3& start_mm, const std::vector<LinearBlock>& blocks, const std::vector<double>& times_s) {
        const std::vector<Vector3> found = linear_positions_mm(start_mm, blocks, times_s);
        Eigen::MatrixXd positions(static_cast<Eigen::Index>(found.size()), axis_count);
        for (std::size_t k = 0; k < found.size(); ++k) positions.row(static_cast<Eigen::Index>(k)) = found[k];
        return positions;
      },
      py::arg("start_mm"), py::arg("blocks"), py::arg("times_s"),
      "Positions of the motion of blocks at ascending times, (n, 3), mm; after the last block its end.");
  module.def(
      "linear_blocks",
      [](const std::shared_ptr<Path>& path, double period_s, double tolerance_mm,
         const std::vector<std::uint32_t>& joints, const AxisModes& modes) {
        const py::gil_scoped_release release;
        return linear_blocks(*path, period_s, tolerance_mm, joints, modes);
      },
      py::arg("path").none(false), py::arg("period_s"), py::arg("tolerance_mm"), py::arg("joints"), py::arg("modes"),
      "Joins blocks of constant feed, each of whole periods, into blocks of linear feed. At the ends of the periods "
      "the motion stays within a tolerance of the original motion. `joints`: ascending indices of blocks that must "
      "begin a joined one; speeds at the end of the path are chosen so that `modes` of X, Y and Z are at rest there.");
  module.def(
      "largest_difference_mm",
      [](const std::shared_ptr<Path>& path, const std::vector<LinearBlock>& blocks, double period_s) {
        return largest_difference_mm(*path, blocks, period_s);
      },
      py::arg("path").none(false), py::arg("blocks"), py::arg("period_s"),
      "Largest distance between the motions of the joined blocks and of the blocks of constant feed, at the ends of "
      "the periods, mm.");
}

}  // namespace shapegcode::bindings
