#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/milling/corner.hpp"
#include "shapegcode/milling/force.hpp"
#include "shapegcode/milling/material.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

static_assert(sizeof(EngagedArc) == 4 * sizeof(double));

py::array read_only(py::array array) {
  py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

/// A column of a track as a read-only array that keeps the track alive.
template <typename Value>
auto column(std::vector<Value> EngagementTrack::*member) {
  return [member](py::object self) -> py::array {
    const auto& values = self.cast<const EngagementTrack&>().*member;
    return read_only(py::array_t<Value>(static_cast<py::ssize_t>(values.size()), values.data(), self));
  };
}

py::array arcs_array(const EngagedArc* first, std::size_t count, const py::object& owner) {
  const auto rows = static_cast<py::ssize_t>(count);
  return read_only(py::array_t<double>({rows, py::ssize_t{4}}, first != nullptr ? &first->from_rad : nullptr, owner));
}

Ring ring_from(const VectorArray& points) {
  if (points.ndim() != 2 || points.shape(1) != 2) {
    throw Error(ErrorKind::argument, "a ring of the stock must have the shape (n, 2)");
  }
  Ring ring(static_cast<std::size_t>(points.shape(0)));
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const auto row = static_cast<py::ssize_t>(i);
    ring[i] = {points.at(row, 0), points.at(row, 1)};
  }
  return ring;
}

py::array ring_array(const Ring& ring) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(ring.size()), 2);
  for (std::size_t i = 0; i < ring.size(); ++i) matrix.row(static_cast<Eigen::Index>(i)) = ring[i];
  return take(std::move(matrix));
}

void register_tool(py::module_& module) {
  py::enum_<SpindleSense>(module, "SpindleSense", "Direction of spindle rotation, seen towards the workpiece.")
      .value("clockwise", SpindleSense::clockwise, "M03.")
      .value("counter_clockwise", SpindleSense::counter_clockwise, "M04.");

  py::class_<EndMill>(module, "EndMill", "A cylindrical end mill with a flat end.")
      .def(py::init([](double diameter_mm, int flutes, double helix_rad, std::vector<double> runout_mm) {
             EndMill tool{diameter_mm, flutes, helix_rad, std::move(runout_mm)};
             check(tool);
             return tool;
           }),
           py::arg("diameter_mm"), py::arg("flutes"), py::arg("helix_rad") = 0.0,
           py::arg("runout_mm") = std::vector<double>{},
           "`helix_rad`: helix angle of a right-hand cutter; `runout_mm`: radius of each flute less the mean radius, "
           "in the order in which they cut. Raises ArgumentError on a value outside its range.")
      .def_readonly("diameter_mm", &EndMill::diameter_mm, "mm.")
      .def_readonly("flutes", &EndMill::flutes, "Number of flutes.")
      .def_readonly("helix_rad", &EndMill::helix_rad, "rad.")
      .def_readonly("runout_mm", &EndMill::runout_mm, "One per flute, or none, mm.")
      .def_property_readonly("radius_mm", &EndMill::radius_mm, "mm.");
}

void register_track(py::module_& module) {
  py::class_<EngagementTrack, std::shared_ptr<EngagementTrack>>(
      module, "EngagementTrack",
      "Engagement of the tool along a path, sample by sample. Azimuths in rad from the direction of feed, positive to "
      "its left; with a clockwise spindle a tooth passes from +pi/2 (up milling) to -pi/2 (down milling).")
      .def("__len__", &EngagementTrack::size)
      .def_property_readonly("s_mm", column(&EngagementTrack::s_mm), "Distance along the path, (n,), mm.")
      .def_property_readonly("x_mm", column(&EngagementTrack::x_mm), "Of the tool's axis, (n,), mm.")
      .def_property_readonly("y_mm", column(&EngagementTrack::y_mm), "Of the tool's axis, (n,), mm.")
      .def_property_readonly("direction_rad", column(&EngagementTrack::direction_rad),
                             "Direction of feed in the XY plane, from +X, (n,), rad; 0 where the tool only plunges.")
      .def_property_readonly("horizontal", column(&EngagementTrack::horizontal),
                             "Component of the travel in the XY plane, (n,): 1 level, 0 a plunge.")
      .def_property_readonly("segment", column(&EngagementTrack::segment), "Index of the path's segment, (n,).")
      .def_property_readonly("radial_depth_mm", column(&EngagementTrack::radial_depth_mm),
                             "Width of cut, perpendicular to the feed, (n,), mm.")
      .def_property_readonly("section_mm2", column(&EngagementTrack::section_mm2),
                             "Area of cut, perpendicular to the feed, (n,), mm2; times feed: material removal rate.")
      .def_property_readonly("plunged_mm2", column(&EngagementTrack::plunged_mm2),
                             "Area of material below the end of a descending tool, (n,), mm2.")
      .def_property_readonly("first_arc", column(&EngagementTrack::first_arc),
                             "Index of each sample's first row of `arcs`, (n + 1,).")
      .def_property_readonly(
          "arcs",
          [](const py::object& self) {
            const auto& track = self.cast<const EngagementTrack&>();
            return arcs_array(track.arcs.data(), track.arcs.size(), self);
          },
          "Engaged sections of the circumference, (m, 4): from and to azimuth, rad, bottom and top above the tip, mm.")
      .def(
          "arcs_of",
          [](const py::object& self, std::size_t sample) {
            const auto& track = self.cast<const EngagementTrack&>();
            if (sample >= track.size()) throw py::index_error("sample index out of range");
            const auto arcs = track.arcs_of(sample);
            return arcs_array(arcs.data(), arcs.size(), self);
          },
          py::arg("sample"), "The rows of `arcs` that belong to a sample, (k, 4).");
}

void register_material(py::module_& module) {
  py::class_<Material, std::shared_ptr<Material>>(
      module, "Material",
      "A workpiece of horizontal layers, each represented by the distance from its boundary on a grid.")
      .def(py::init([](const std::vector<VectorArray>& rings, const std::vector<double>& borders, double resolution,
                       std::size_t memory_limit) {
             std::vector<Ring> outlines;
             outlines.reserve(rings.size());
             for (const VectorArray& points : rings) outlines.push_back(ring_from(points));
             const py::gil_scoped_release release;
             return std::make_shared<Material>(outlines, borders, resolution, memory_limit);
           }),
           py::arg("rings_mm"), py::arg("borders_mm"), py::arg("resolution_mm"),
           py::arg("memory_limit_bytes") = Material::default_memory_limit_bytes,
           "`rings_mm`: outlines of the stock, each (n, 2), holes included (even-odd rule); `borders_mm`: heights "
           "between the layers from bottom to top (see layer_borders); `resolution_mm`: grid spacing (a hundredth of "
           "the tool's diameter is a good choice). Raises ArgumentError on an outline or heights that enclose nothing, "
           "or a grid that needs more memory than the limit.")
      .def("take_whole_layers", &Material::take_whole_layers,
           "From now on removes a layer only if the tip reaches its bottom. The remaining material is then never "
           "underestimated, also under a ramp.")
      .def("compact", &Material::compact, "Frees the memory of tiles that have become uniform.")
      .def(
          "copy", [](const Material& self) { return std::make_shared<Material>(self); },
          "An independent copy of the material in its present state.")
      .def("__len__", &Material::size)
      .def_property_readonly("borders_mm", &Material::borders_mm, "Heights between the layers, ascending, mm.")
      .def_property_readonly("bottom_mm", &Material::bottom_mm, "Bottom of the stock, mm.")
      .def_property_readonly("top_mm", &Material::top_mm, "Top of the original stock, mm.")
      .def_property_readonly("resolution_mm", &Material::resolution_mm, "Grid spacing, mm.")
      .def_property_readonly("low_mm", &Material::low_mm, "Low corner of the original stock, (2,), mm.")
      .def_property_readonly("high_mm", &Material::high_mm, "High corner of the original stock, (2,), mm.")
      .def_property_readonly("volume_mm3", &Material::volume_mm3, "Remaining volume, mm3.")
      .def_property_readonly("bytes", &Material::bytes, "Memory in use.")
      .def("is_material", &Material::is_material, py::arg("x_mm"), py::arg("y_mm"), py::arg("z_mm"),
           "Whether there is material at a point.")
      .def(
          "distance_mm",
          [](const Material& self, std::size_t layer, double x, double y) {
            if (layer >= self.size()) throw py::index_error("layer index out of range");
            return self.distance_mm(layer, x, y);
          },
          py::arg("layer"), py::arg("x_mm"), py::arg("y_mm"),
          "Distance from the boundary of a layer, positive in material, limited to twice the grid spacing, mm.")
      .def("volume_in_cylinder_mm3", &Material::volume_in_cylinder_mm3, py::arg("x_mm"), py::arg("y_mm"),
           py::arg("radius_mm"), py::arg("bottom_mm"), py::arg("top_mm"),
           "Material in a vertical cylinder, mm3, such as a tool at its start position.")
      .def(
          "heights_mm",
          [](const Material& self, const Eigen::Vector2d& low, const Eigen::Vector2d& high, py::ssize_t rows,
             py::ssize_t columns) { return take(self.heights_mm(low, high, rows, columns)); },
          py::arg("low_mm"), py::arg("high_mm"), py::arg("rows"), py::arg("columns"),
          "Top of the material over a rectangle, rows along Y, columns along X, mm, from its low corner on; NaN where "
          "there is none. Raises ArgumentError on less than one row or column.");
}

void register_layer_borders(py::module_& module) {
  module.def(
      "layer_borders",
      [](const std::vector<std::shared_ptr<Path>>& paths, double bottom, double top, double ramp_step) {
        std::vector<const Path*> pointers;
        pointers.reserve(paths.size());
        for (const auto& path : paths) {
          if (path == nullptr) throw py::type_error("layer_borders: paths hold None");
          pointers.push_back(path.get());
        }
        return layer_borders(pointers, bottom, top, ramp_step);
      },
      py::arg("paths"), py::arg("bottom_mm"), py::arg("top_mm"), py::arg("ramp_step_mm"),
      "Heights between layers for these paths in a stock from bottom to top, mm: the heights of level moves, the "
      "lowest points of ramps and plunges, and steps of at most `ramp_step_mm` along ramps and helices (a tenth of the "
      "tool's diameter is a good choice). Raises ArgumentError unless bottom < top and the step is positive.");
}

void register_sweep(py::module_& module) {
  module.def(
      "sweep",
      [](Material& material, const std::shared_ptr<Path>& path, double diameter, double step, double touch,
         const std::optional<py::function>& progress) {
        SweepOptions options;
        options.step_mm = step;
        options.touch_mm = touch;
        if (progress) {
          options.progress = [&](double s) {
            const py::gil_scoped_acquire acquire;
            (*progress)(s);
          };
        }
        const py::gil_scoped_release release;
        return std::make_shared<EngagementTrack>(sweep(material, *path, diameter, options));
      },
      py::arg("material"), py::arg("path").none(false), py::arg("tool_diameter_mm"), py::kw_only(),
      py::arg("step_mm") = 0.0, py::arg("touch_mm") = SweepOptions{}.touch_mm, py::arg("progress") = std::nullopt,
      "Moves a tool along a path through the material, removes the swept volume and returns the engagement. Samples "
      "are at most `step_mm` apart (0: a fortieth of the diameter) and at the end of every segment; contacts less deep "
      "or less wide than `touch_mm` are ignored. `progress` is called from time to time with the distance travelled, "
      "mm. Material inside the tool at the start counts as removed; a rapid is swept like any other move. Raises "
      "ArgumentError on values out of range, an arc outside of the XY plane, or if the memory limit is exceeded.");
}

void register_corner(py::module_& module) {
  py::enum_<CornerSection>(module, "CornerSection", "Sections S1 to S4 of paper 001.")
      .value("s1", CornerSection::s1, "Straight, the tool enters at the straight rough wall.")
      .value("s2", CornerSection::s2, "Straight, the tool enters in the rough corner.")
      .value("s3", CornerSection::s3, "On the arc of the finished corner.")
      .value("s4", CornerSection::s4, "On the straight after it.");

  py::class_<CornerEngagement>(module, "CornerEngagement", "Engagement of the tool at one position of a corner.")
      .def_readonly("section", &CornerEngagement::section, "Section of the path.")
      .def_readonly("x_mm", &CornerEngagement::x_mm, "Of the tool's axis, mm.")
      .def_readonly("y_mm", &CornerEngagement::y_mm, "Of the tool's axis, mm.")
      .def_readonly("direction_rad", &CornerEngagement::direction_rad, "Direction of feed, from +X, rad.")
      .def_readonly("turned_rad", &CornerEngagement::turned_rad, "Angle turned on the tool centre's arc so far, rad.")
      .def_readonly("from_rad", &CornerEngagement::from_rad, "Engaged azimuths, from the direction of feed, rad.")
      .def_readonly("to_rad", &CornerEngagement::to_rad, "rad.")
      .def_readonly("radial_depth_mm", &CornerEngagement::radial_depth_mm,
                    "Width of cut: from the end of the engagement on the rough boundary to the finished wall's tangent "
                    "at the contact, mm.");

  py::class_<CornerCut>(module, "CornerCut", "The corner of a pocket that is finished after roughing (paper 001).")
      .def(py::init([](double tool_radius, double rough_radius, double finish_radius, double allowance, double turn,
                       double before, double after, bool mirrored) {
             const CornerCut cut{tool_radius, rough_radius, finish_radius, allowance, turn, before, after, mirrored};
             check(cut);
             return cut;
           }),
           py::arg("tool_radius_mm"), py::arg("rough_radius_mm"), py::arg("finish_radius_mm"), py::arg("allowance_mm"),
           py::arg("turn_rad") = CornerCut{}.turn_rad, py::arg("before_mm") = CornerCut{}.before_mm,
           py::arg("after_mm") = CornerCut{}.after_mm, py::arg("mirrored") = false,
           "The tool moves along +X with the wall to its right, turns left by `turn_rad` and follows the second wall; "
           "the finished walls meet at the origin. `mirrored`: wall to the left. Equal tool and finish radius: the "
           "path has a sharp vertex. Raises ArgumentError on corner radii below the tool's, an allowance above the "
           "radius of the tool, or a rough corner that leaves no material.")
      .def_readonly("tool_radius_mm", &CornerCut::tool_radius_mm, "mm.")
      .def_readonly("rough_radius_mm", &CornerCut::rough_radius_mm, "Radius of the corner after roughing, mm.")
      .def_readonly("finish_radius_mm", &CornerCut::finish_radius_mm, "Radius of the corner to be made, mm.")
      .def_readonly("allowance_mm", &CornerCut::allowance_mm, "Allowance left on both walls by roughing, mm.")
      .def_readonly("turn_rad", &CornerCut::turn_rad, "Turning angle of the path, rad.")
      .def_readonly("before_mm", &CornerCut::before_mm, "Straight path before the corner, mm.")
      .def_readonly("after_mm", &CornerCut::after_mm, "Straight path after the corner, mm.")
      .def_readonly("mirrored", &CornerCut::mirrored, "The wall is to the left.")
      .def_property_readonly("length_mm", &corner_length_mm, "Length of the tool's path, mm.")
      .def("path", &corner_path, py::arg("feed_mm_per_s"), py::arg("z_mm") = 0.0,
           "The tool's path: line, arc if the radii differ, line.")
      .def(
          "stock", [](const CornerCut& self, double beyond) { return ring_array(corner_stock(self, beyond)); },
          py::arg("beyond_mm"),
          "The material before finishing as a ring (n, 2), mm, to `beyond_mm` outside of the walls.")
      .def("at", &corner_engagement, py::arg("s_mm"), py::arg("behind_vertex") = false,
           "Engagement at a distance along the path, in closed form; `behind_vertex`: at a sharp vertex, after the "
           "turn.")
      .def(
          "track",
          [](const CornerCut& self, double axial_depth, double step) {
            return std::make_shared<EngagementTrack>(corner_track(self, axial_depth, step));
          },
          py::arg("axial_depth_mm"), py::arg("step_mm"),
          "The closed form as a track with samples at most `step_mm` apart; at a sharp vertex two share one position.");
}

}  // namespace

void register_engagement(py::module_& module) {
  register_tool(module);
  register_track(module);
  register_material(module);
  register_layer_borders(module);
  register_sweep(module);
  register_corner(module);
}

}  // namespace shapegcode::bindings
