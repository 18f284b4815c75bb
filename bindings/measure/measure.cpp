#include <pybind11/stl.h>

#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/measure/sections.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

std::span<const double> profile_of(const VectorArray& values) {
  if (values.ndim() != 1) {
    throw Error(ErrorKind::argument, "a profile must have the shape (n,)");
  }
  return {values.data(), static_cast<std::size_t>(values.size())};
}

py::array vector(std::vector<double> values) {
  auto owned = std::make_unique<std::vector<double>>(std::move(values));
  const std::vector<double>& reference = *owned;
  const py::capsule owner(owned.release(), [](void* p) { delete static_cast<std::vector<double>*>(p); });
  return py::array_t<double>(static_cast<py::ssize_t>(reference.size()), reference.data(), owner);
}

py::array points(const std::vector<Eigen::Vector2d>& list) {
  Eigen::MatrixXd matrix(static_cast<Eigen::Index>(list.size()), 2);
  for (std::size_t i = 0; i < list.size(); ++i) {
    matrix.row(static_cast<Eigen::Index>(i)) = list[i];
  }
  return take(std::move(matrix));
}

void register_sections(py::module_& module) {
  py::enum_<SectionKind>(module, "SectionKind", "Kind of a section of a path.")
      .value("line", SectionKind::line, "Lines of one direction.")
      .value("arc", SectionKind::arc, "Arcs about one centre.")
      .value("curve", SectionKind::curve, "Anything else.");

  py::class_<PathSection>(module, "PathSection", "A section of a path that is measured separately.")
      .def_readonly("first", &PathSection::first, "Index of its first segment.")
      .def_readonly("last", &PathSection::last, "Index of its last segment.")
      .def_readonly("begin_mm", &PathSection::begin_mm, "Distance of its start from the path's start, mm.")
      .def_readonly("end_mm", &PathSection::end_mm, "Distance of its end from the path's start, mm.")
      .def_readonly("first_line", &PathSection::first_line, "Source line of its first segment, from 1.")
      .def_readonly("last_line", &PathSection::last_line, "Source line of its last segment.")
      .def_readonly("kind", &PathSection::kind, "Line, arc or curve.")
      .def_readonly("stops_at_end", &PathSection::stops_at_end, "The path stops at its end.")
      .def_property_readonly("length_mm", &PathSection::length_mm, "mm.");

  module.def(
      "path_sections",
      [](const std::shared_ptr<Path>& path, double short_mm) { return path_sections(*path, short_mm); },
      py::arg("path").none(false), py::arg("short_mm") = 0.5,
      "The whole path as sections: sequences of lines of one direction and of arcs about one centre, which end at an "
      "exact stop at the latest. Successive sequences shorter than `short_mm` are one section of the kind `curve`.");
  module.def(
      "line_sections",
      [](const std::shared_ptr<Path>& path, const std::vector<std::pair<std::uint32_t, std::uint32_t>>& ranges) {
        std::vector<LineRange> lines;
        lines.reserve(ranges.size());
        for (const auto& [first, last] : ranges) {
          lines.push_back({first, last});
        }
        return line_sections(*path, lines);
      },
      py::arg("path").none(false), py::arg("ranges"),
      "The parts of a path that come from `ranges` of source lines, pairs of first and last line. Raises ArgumentError "
      "if a range runs backwards or two overlap.");
}

void register_fits(py::module_& module) {
  py::class_<CircleFit>(module, "CircleFit", "Least-squares circle through points (radial distances).")
      .def_readonly("centre_mm", &CircleFit::centre_mm, "(2,), mm.")
      .def_readonly("radius_mm", &CircleFit::radius_mm, "mm.")
      .def_readonly("form_mm", &CircleFit::form_mm, "Largest less smallest radial distance from the circle, mm.")
      .def_readonly("rms_mm", &CircleFit::rms_mm, "Root mean square of the radial distances, mm.");
  module.def(
      "fit_circle",
      [](const py::array_t<double, py::array::c_style | py::array::forcecast>& points) {
        if (points.ndim() != 2 || points.shape(1) != 2) {
          throw Error(ErrorKind::argument, "points must have the shape (n, 2)");
        }
        std::vector<Eigen::Vector2d> list(static_cast<std::size_t>(points.shape(0)));
        for (std::size_t i = 0; i < list.size(); ++i) {
          list[i] = {points.at(i, 0), points.at(i, 1)};
        }
        return fit_circle(list);
      },
      py::arg("points_mm"),
      "Geometric least-squares circle through points (n, 2), mm. Raises ArgumentError on fewer than three points or "
      "points on a line, NumericError if it does not converge.");

  py::class_<Roughness>(module, "Roughness", "Figures of a profile after ISO 4287.")
      .def_readonly("cutoff_mm", &Roughness::cutoff_mm, "Cut-off lambda c, mm.")
      .def_readonly("evaluated_mm", &Roughness::evaluated_mm, "Evaluation length: without one cut-off at each end, mm.")
      .def_readonly("ra_mm", &Roughness::ra_mm, "Arithmetic mean height of the roughness, mm.")
      .def_readonly("rz_mm", &Roughness::rz_mm, "Mean peak-to-valley height over sampling lengths, mm.")
      .def_readonly("wa_mm", &Roughness::wa_mm, "Arithmetic mean height of the waviness, mm.");
  module.def(
      "gaussian_low_pass",
      [](const VectorArray& profile, double spacing_mm, double cutoff_mm) {
        return vector(gaussian_low_pass(profile_of(profile), spacing_mm, cutoff_mm));
      },
      py::arg("profile_mm"), py::arg("spacing_mm"), py::arg("cutoff_mm"),
      "Gaussian low-pass filter of ISO 16610-21: the part of a profile with wavelengths above the cut-off, (n,), mm.");
  module.def(
      "measure_roughness",
      [](const VectorArray& profile, double spacing_mm, double cutoff_mm, double lambda_s_mm) {
        return measure_roughness(profile_of(profile), spacing_mm, cutoff_mm, lambda_s_mm);
      },
      py::arg("profile_mm"), py::arg("spacing_mm"), py::arg("cutoff_mm"), py::arg("lambda_s_mm") = 0.0,
      "Ra, Rz and Wa of an evenly spaced profile (n,), mm, without one cut-off at each end. Raises ArgumentError if "
      "less than one sampling length remains.");
}

void register_figures(py::module_& module) {
  py::class_<RestVibration>(module, "RestVibration", "Vibration of a plant while its command is at rest.")
      .def_readonly("begin_s", &RestVibration::begin_s, "Start of the rest of the command, s.")
      .def_readonly("observed_s", &RestVibration::observed_s, "Duration of the rest, s.")
      .def_readonly("residual_mm", &RestVibration::residual_mm, "Largest |response - command|, (3,), mm.")
      .def_readonly("settling_s", &RestVibration::settling_s,
                    "Time until |response - command| stays within the band, (3,), s; NaN if it left the band in the "
                    "last eighth of the rest.");

  py::class_<WallFigures>(module, "WallFigures", "One wall of a section, or the width between both.")
      .def_readonly("least_mm", &WallFigures::least_mm, "mm.")
      .def_readonly("mean_mm", &WallFigures::mean_mm, "mm.")
      .def_readonly("largest_mm", &WallFigures::largest_mm, "mm.")
      .def_readonly("stations", &WallFigures::stations, "Number of positions at which it could be measured.")
      .def_property_readonly("band_mm", &WallFigures::band_mm, "Largest less least, mm.");

  py::class_<ArcFigures>(module, "ArcFigures", "A circle fitted to the motion or to the wall cut on an arc.")
      .def_readonly("fit", &ArcFigures::fit, "Least-squares circle.")
      .def_readonly("mean_radius_mm", &ArcFigures::mean_radius_mm, "Mean distance from the programmed centre, mm.");

  py::class_<SideFigures>(module, "SideFigures", "Largest distance from the path on each side of it.")
      .def_readonly("left_mm", &SideFigures::left_mm, "mm.")
      .def_readonly("right_mm", &SideFigures::right_mm, "mm.")
      .def_readonly("above_mm", &SideFigures::above_mm, "Above: more along Z than across the path, mm.")
      .def_readonly("below_mm", &SideFigures::below_mm, "Below: likewise, mm.");

  py::class_<SectionFigures>(module, "SectionFigures", "What was measured in one section.")
      .def_readonly("section", &SectionFigures::section, "The section.")
      .def_readonly("time_s", &SectionFigures::time_s, "Time in which the command moves in it, s.")
      .def_readonly("peak_mm", &SectionFigures::peak_mm, "Largest |response - command| during motion, (3,), mm.")
      .def_readonly("rest", &SectionFigures::rest,
                    "Worst stop of the command in it (largest residual); in the section where the motion ends, its "
                    "last stop; or None.")
      .def_readonly("command", &SectionFigures::command, "Deviation of the command from the path.")
      .def_readonly("response", &SectionFigures::response, "Deviation of the response from the path.")
      .def_readonly("command_sides", &SectionFigures::command_sides, "Deviation of the command, by side of the path.")
      .def_readonly("response_sides", &SectionFigures::response_sides,
                    "Deviation of the response, by side of the path.")
      .def_readonly("command_orbit_percent", &SectionFigures::command_orbit_percent, "Orbit error; arcs only.")
      .def_readonly("response_orbit_percent", &SectionFigures::response_orbit_percent, "Orbit error; arcs only.")
      .def_readonly("nominal_radius_mm", &SectionFigures::nominal_radius_mm, "Programmed radius, mm; arcs only.")
      .def_readonly("turns_left", &SectionFigures::turns_left, "The left wall is the inside one; arcs only.")
      .def_readonly("nominal_centre_mm", &SectionFigures::nominal_centre_mm, "(2,) in the plane of the arc, mm.")
      .def_readonly("command_arc", &SectionFigures::command_arc, "Circle through the command; arcs from 10 degrees on.")
      .def_readonly("response_arc", &SectionFigures::response_arc, "Circle through the response.")
      .def_readonly("left_wall_arc", &SectionFigures::left_wall_arc, "Circle through the left wall; XY plane only.")
      .def_readonly("right_wall_arc", &SectionFigures::right_wall_arc, "Circle through the right wall.")
      .def_readonly("left", &SectionFigures::left, "Left wall less the programmed wall, positive to the left.")
      .def_readonly("right", &SectionFigures::right, "Right wall less the programmed wall, positive to the left.")
      .def_readonly("width", &SectionFigures::width, "Left less right wall plus the tool's diameter.")
      .def_readonly("left_roughness", &SectionFigures::left_roughness, "Roughness of the wall, or None if too short.")
      .def_readonly("right_roughness", &SectionFigures::right_roughness,
                    "Roughness of the wall, or None if too short.");

  py::class_<TrackFigures, std::shared_ptr<TrackFigures>>(module, "TrackFigures", "Figures of all samples measured.")
      .def_readonly("sections", &TrackFigures::sections, "In the order of the path.")
      .def_readonly("duration_s", &TrackFigures::duration_s, "Time until the command rests for the last time, s.")
      .def_readonly("rest", &TrackFigures::rest, "The stop at the end.")
      .def_readonly("command", &TrackFigures::command, "Deviation from the path; missed corners count.")
      .def_readonly("response", &TrackFigures::response, "Deviation from the path; missed corners count.")
      .def_readonly("command_sides", &TrackFigures::command_sides, "By sides, without missed corners.")
      .def_readonly("response_sides", &TrackFigures::response_sides, "By sides, without missed corners.");
}

void register_options(py::module_& module) {
  py::class_<MetrologyOptions>(module, "MetrologyOptions", "Options of SectionMetrology.")
      .def(py::init<>())
      .def_readwrite("period_s", &MetrologyOptions::period_s, "Time between two samples, s.")
      .def_readwrite("tool_radius_mm", &MetrologyOptions::tool_radius_mm, "Radius of the disc that is swept, mm.")
      .def_readwrite("station_spacing_mm", &MetrologyOptions::station_spacing_mm,
                     "Largest distance of two stations, mm.")
      .def_readwrite("band_mm", &MetrologyOptions::band_mm, "Band in which the response counts as settled, mm.")
      .def_readwrite("least_rest_s", &MetrologyOptions::least_rest_s, "A shorter rest within the path is no stop, s.")
      .def_readwrite("cutoff_mm", &MetrologyOptions::cutoff_mm, "Cut-off lambda c, mm; 0: as in ISO 4288.")
      .def_readwrite("lambda_s_mm", &MetrologyOptions::lambda_s_mm, "Short-wave cut-off, mm; 0: none.");
}

void register_section_metrology(py::module_& module) {
  py::class_<SectionMetrology>(module, "SectionMetrology", "Measures a motion per section of a path, sample by sample.")
      .def(py::init([](const std::shared_ptr<Path>& path, std::vector<PathSection> sections,
                       const MetrologyOptions& options) {
             return std::make_unique<SectionMetrology>(*path, std::move(sections), options);
           }),
           py::arg("path").none(false), py::arg("sections"), py::arg("options"),
           "Raises ArgumentError on a path without length, sections of another path, or an option outside its range.")
      .def(
          "feed",
          [](SectionMetrology& self, const MatrixArray& command_mm, const MatrixArray& response_mm) {
            const Samples command = samples_from(command_mm, 1.0);
            const Samples response = samples_from(response_mm, 1.0);
            if (command.positions_mm.rows() != response.positions_mm.rows()) {
              throw Error(ErrorKind::argument,
                          "command and response differ in length: " + std::to_string(command.positions_mm.rows()) +
                              " and " + std::to_string(response.positions_mm.rows()) + " samples");
            }
            const py::gil_scoped_release release;
            for (Eigen::Index i = 0; i < command.positions_mm.rows(); ++i) {
              self.step(command.positions_mm.row(i), response.positions_mm.row(i));
            }
          },
          py::arg("command_mm"), py::arg("response_mm"),
          "Takes the next samples of command and response, (n, 3), mm. Raises ArgumentError on other shapes or values "
          "that are not finite.")
      .def(
          "finish",
          [](const SectionMetrology& self) {
            const py::gil_scoped_release release;
            return std::make_shared<TrackFigures>(self.finish());
          },
          "Everything measured so far. Raises NumericError if a circle fit does not converge.")
      .def(
          "wall_profile",
          [](const SectionMetrology& self, std::size_t section) {
            if (section >= self.sections().size()) {
              throw py::index_error("section index out of range");
            }
            SweptWalls::Profile profile = self.wall_profile(section);
            const py::array point = points(profile.point);
            const py::array normal = points(profile.normal);
            return py::make_tuple(profile.first_mm, profile.spacing_mm, vector(std::move(profile.left)),
                                  vector(std::move(profile.right)), point, normal);
          },
          py::arg("section"),
          "Returns distance of the first station from the path's start, mm; spacing, mm; deviations of the left and of "
          "the right wall, (n,), mm, positive to the left, NaN where there is no wall; the path's points and its left "
          "normals, both seen from above, (n, 2).")
      .def_property_readonly("station_spacing_mm", &SectionMetrology::station_spacing_mm,
                             "Largest distance of two stations, mm.");
}

}  // namespace

void register_metrology(py::module_& module) {
  register_sections(module);
  register_fits(module);
  register_figures(module);
  register_options(module);
  register_section_metrology(module);
}

}  // namespace shapegcode::bindings
