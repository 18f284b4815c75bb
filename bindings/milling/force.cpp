#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/milling/feed.hpp"
#include "shapegcode/milling/force.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

constexpr const char* arcs_shape =
    "engaged arcs must have the shape (n_arcs, 4): from and to in rad, bottom and top in mm";

std::vector<EngagedArc> arcs_from(const MatrixArray& arcs) {
  if (arcs.size() == 0 && arcs.ndim() <= 2) return {};
  if (arcs.ndim() != 2 || arcs.shape(1) != 4) throw Error(ErrorKind::argument, arcs_shape);
  std::vector<EngagedArc> out;
  const auto at = arcs.unchecked<2>();
  for (py::ssize_t i = 0; i < at.shape(0); ++i) out.push_back({at(i, 0), at(i, 1), at(i, 2), at(i, 3)});
  return out;
}

std::span<const double> span_of(const VectorArray& values) {
  if (values.ndim() != 1) throw Error(ErrorKind::argument, "feeds and heights must have the shape (n,)");
  return {values.data(), static_cast<std::size_t>(values.size())};
}

py::dict columns(const Eigen::MatrixXd& table) {
  static constexpr const char* names[] = {"mean_x_n",         "mean_y_n",       "mean_resultant_n",
                                          "peak_resultant_n", "peak_torque_nm", "mean_torque_nm",
                                          "mean_power_w",     "peak_chip_mm",   "peak_deflection_um"};
  static_assert(std::size(names) == force_columns);
  py::dict out;
  for (int k = 0; k < force_columns; ++k) {
    py::array_t<double> column(table.rows());
    std::copy_n(table.col(k).data(), table.rows(), column.mutable_data());
    out[names[k]] = column;
  }
  return out;
}

void define_coefficients(py::module_& module) {
  py::enum_<ChipThickness>(module, "ChipThickness", "Chip thickness used in the specific cutting force.")
      .value("mean", ChipThickness::mean, "Of the whole engagement, as paper 001 fits its coefficients.")
      .value("local", ChipThickness::local, "Of each element of a flute.");

  py::class_<CuttingCoefficients>(module, "CuttingCoefficients",
                                  R"(Power laws of the cutting force (paper 001 eq. 2, 3, 8, 9), with edge forces.

Per mm of a flute's height, t being the chip thickness in mm: tangential k1 t + K_te, radial k2 k1 t + K_re in N/mm,
with k1 = specific_n_per_mm2 * t**specific_exponent, k2 = ratio * t**ratio_exponent.)")
      .def(py::init([](double specific_n_per_mm2, double specific_exponent, double ratio, double ratio_exponent,
                       double tangential_edge_n_per_mm, double radial_edge_n_per_mm, ChipThickness thickness) {
             const CuttingCoefficients c{specific_n_per_mm2,       specific_exponent,    ratio,    ratio_exponent,
                                         tangential_edge_n_per_mm, radial_edge_n_per_mm, thickness};
             check(c);
             return c;
           }),
           py::arg("specific_n_per_mm2"), py::arg("specific_exponent") = 0.0, py::arg("ratio") = 0.0,
           py::arg("ratio_exponent") = 0.0, py::arg("tangential_edge_n_per_mm") = 0.0,
           py::arg("radial_edge_n_per_mm") = 0.0, py::arg("thickness") = ChipThickness::mean,
           "Raises ArgumentError on a value that is not finite, a force or ratio below 0, or an exponent (tangential, "
           "or sum of both) of -1 or less.")
      .def_readonly("specific_n_per_mm2", &CuttingCoefficients::specific_n_per_mm2, "k1 at a chip of 1 mm, N/mm2.")
      .def_readonly("specific_exponent", &CuttingCoefficients::specific_exponent, "Of k1.")
      .def_readonly("ratio", &CuttingCoefficients::ratio, "k2 at a chip of 1 mm.")
      .def_readonly("ratio_exponent", &CuttingCoefficients::ratio_exponent, "Of k2.")
      .def_readonly("tangential_edge_n_per_mm", &CuttingCoefficients::tangential_edge_n_per_mm, "K_te, N/mm.")
      .def_readonly("radial_edge_n_per_mm", &CuttingCoefficients::radial_edge_n_per_mm, "K_re, N/mm.")
      .def_readonly("thickness", &CuttingCoefficients::thickness, "Mean or local.");
}

void define_beam(py::module_& module) {
  constexpr double rigid = std::numeric_limits<double>::infinity();
  py::class_<ToolBeam>(module, "ToolBeam",
                       "An end mill as a beam clamped at its overhang: shank, and a fluted part that is as stiff as a "
                       "round bar of an effective diameter. Heights count from the tip.")
      .def(py::init([](double overhang_mm, double fluted_length_mm, double effective_diameter_mm,
                       double shank_diameter_mm, double young_modulus_gpa, double holder_n_per_um,
                       double spindle_n_per_um) {
             const ToolBeam beam{overhang_mm,       fluted_length_mm, effective_diameter_mm, shank_diameter_mm,
                                 young_modulus_gpa, holder_n_per_um,  spindle_n_per_um};
             check(beam);
             return beam;
           }),
           py::arg("overhang_mm"), py::arg("fluted_length_mm"), py::arg("effective_diameter_mm"),
           py::arg("shank_diameter_mm"), py::arg("young_modulus_gpa"), py::arg("holder_n_per_um") = rigid,
           py::arg("spindle_n_per_um") = rigid,
           "Lengths and diameters in mm, modulus in GPa, springs between the clamped end and the frame in N/um (inf: "
           "rigid). Raises ArgumentError on a value that is not positive.")
      .def_readonly("overhang_mm", &ToolBeam::overhang_mm, "Tip to clamped end, mm.")
      .def_readonly("fluted_length_mm", &ToolBeam::fluted_length_mm, "From the tip, mm.")
      .def_readonly("effective_diameter_mm", &ToolBeam::effective_diameter_mm, "Of the fluted part, mm.")
      .def_readonly("shank_diameter_mm", &ToolBeam::shank_diameter_mm, "mm.")
      .def_readonly("young_modulus_gpa", &ToolBeam::young_modulus_gpa, "GPa.")
      .def_readonly("holder_n_per_um", &ToolBeam::holder_n_per_um, "N/um.")
      .def_readonly("spindle_n_per_um", &ToolBeam::spindle_n_per_um, "N/um.")
      .def("compliance_um_per_n", &compliance_um_per_n, py::arg("at_mm"), py::arg("load_mm"),
           "Deflection at one height under 1 N across the axis at another, um/N (both count from the tip).");
}

void define_figures(py::module_& module) {
  py::class_<ForceFigures>(module, "ForceFigures",
                           "Figures over one revolution; forces on the tool, x along the feed and y to its left.")
      .def_readonly("mean_n", &ForceFigures::mean_n, "Mean of the vector, (2,), N.")
      .def_readonly("mean_resultant_n", &ForceFigures::mean_resultant_n, "Mean of the magnitude, N.")
      .def_readonly("peak_resultant_n", &ForceFigures::peak_resultant_n, "Largest magnitude, N.")
      .def_readonly("peak_flute_n", &ForceFigures::peak_flute_n, "Largest magnitude on a single flute, N.")
      .def_readonly("mean_torque_nm", &ForceFigures::mean_torque_nm, "N m.")
      .def_readonly("peak_torque_nm", &ForceFigures::peak_torque_nm, "N m.")
      .def_readonly("mean_power_w", &ForceFigures::mean_power_w, "Mean torque times angular speed, W.")
      .def_readonly("peak_chip_mm", &ForceFigures::peak_chip_mm, "Thickest chip, mm.");

  py::class_<ForceCurve>(module, "ForceCurve", "Forces on the tool over one revolution, in the frame of the tool.")
      .def_readonly("turned_rad", &ForceCurve::turned_rad,
                    "Spindle angle in its direction of rotation, rad, (n_angles,); at 0 the first flute's tip points "
                    "along the feed.")
      .def_readonly("force_n", &ForceCurve::force_n, "(n_angles, 2), N.")
      .def_readonly("torque_nm", &ForceCurve::torque_nm, "(n_angles,), N m.")
      .def_readonly("flute_n", &ForceCurve::flute_n, "Of each flute, (n_angles, 2), N.");
}

/// The members come with define_force_members and define_track_figures.
py::class_<MillingForce> define_force(py::module_& module) {
  py::class_<MillingForce> type(module, "MillingForce",
                                R"(Forces of an end mill at one engagement; reuse one object, which stores tables.

The chip at azimuth p is feed per tooth * cos p thick (paper 001 eq. 1); with runout that of flute i is the minimum of
m * feed per tooth * cos p + r_i - r_(i-m), m >= 1, and not below 0. A counter-clockwise spindle mirrors everything,
helix included. `arcs`: (n_arcs, 4): from and to in rad from the direction of feed, positive to its left, bottom and top
in mm above the tip. `feed_mm_per_min`: along the path. Not thread-safe.

Raises:
    ArgumentError: A speed that is not positive; in all members also an arc beyond -pi/2 ... pi/2 or below the tip, or a
        feed that is negative or not finite.)");
  type.def(py::init<EndMill, CuttingCoefficients, double, SpindleSense>(), py::arg("tool"), py::arg("coefficients"),
           py::arg("spindle_rev_per_min"), py::arg("sense") = SpindleSense::clockwise,
           "Spindle speed in 1/min. Raises ArgumentError unless it is positive.")
      .def_property_readonly("tool", &MillingForce::tool, "The cutter.")
      .def_property_readonly("coefficients", &MillingForce::coefficients, "The power laws.")
      .def_property_readonly("spindle_rev_per_min", &MillingForce::spindle_rev_per_min, "1/min.")
      .def_property_readonly("sense", &MillingForce::sense, "M03 or M04.");
  return type;
}

void define_force_members(py::class_<MillingForce>& type) {
  type.def(
          "figures",
          [](MillingForce& self, const MatrixArray& arcs, double feed_mm_per_min) {
            return self.figures(arcs_from(arcs), feed_mm_per_min);
          },
          py::arg("arcs"), py::arg("feed_mm_per_min"),
          "Figures over one revolution: means exact, peaks and mean of the magnitude to 0.1 %; zeros without "
          "engagement.")
      .def(
          "curve",
          [](MillingForce& self, const MatrixArray& arcs, double feed_mm_per_min, int angles) {
            return self.curve(arcs_from(arcs), feed_mm_per_min, angles);
          },
          py::arg("arcs"), py::arg("feed_mm_per_min"), py::arg("angles") = 360,
          "Forces at equal steps of the spindle. Raises ArgumentError on angles < 1.")
      .def(
          "peak_deflection_um",
          [](MillingForce& self, const MatrixArray& arcs, double feed_mm_per_min, const ToolBeam& beam) {
            return self.peak_deflection_um(arcs_from(arcs), feed_mm_per_min, beam);
          },
          py::arg("arcs"), py::arg("feed_mm_per_min"), py::arg("beam"),
          "Largest deflection of the tip over one revolution, um, quasi-static. Raises ArgumentError also where the "
          "engagement lies above the overhang.")
      .def(
          "deflection_um",
          [](MillingForce& self, const MatrixArray& arcs, double feed_mm_per_min, double turned_rad, double height_mm,
             const ToolBeam& beam) {
            return self.deflection_um(arcs_from(arcs), feed_mm_per_min, turned_rad, height_mm, beam);
          },
          py::arg("arcs"), py::arg("feed_mm_per_min"), py::arg("turned_rad"), py::arg("height_mm"), py::arg("beam"),
          "Deflection at a height above the tip and an angle of the spindle (as in ForceCurve), (2,), um, frame of the "
          "tool.")
      .def(
          "force_centre_mm",
          [](MillingForce& self, const MatrixArray& arcs, double feed_mm_per_min, double turned_rad,
             double overhang_mm) {
            return self.force_centre_mm(arcs_from(arcs), feed_mm_per_min, turned_rad, overhang_mm);
          },
          py::arg("arcs"), py::arg("feed_mm_per_min"), py::arg("turned_rad"), py::arg("overhang_mm"),
          "Centre of the force along x and along y (paper 001 eq. 6), distance from the clamped end, (2,), mm; NaN "
          "where that force is 0.");
}

void define_track_figures(py::class_<MillingForce>& type) {
  type.def(
      "figures_of",
      [](MillingForce& self, const EngagementTrack& track, const VectorArray& feed_mm_per_min,
         const std::optional<ToolBeam>& beam) {
        const auto feeds = span_of(feed_mm_per_min);
        Eigen::MatrixXd table;
        {
          const py::gil_scoped_release release;
          table = figures_of(self, track, feeds, beam ? &*beam : nullptr);
        }
        return columns(table);
      },
      py::arg("track"), py::arg("feed_mm_per_min"), py::arg("beam") = py::none(),
      R"(Figures of a whole track, a feed along the path for each sample.

Returns:
    Arrays (n_samples,) by name: mean_x_n, mean_y_n (frame of the tool), mean_resultant_n, peak_resultant_n,
    peak_torque_nm, mean_torque_nm, mean_power_w, peak_chip_mm, peak_deflection_um (of the tip; 0 without a beam).

Raises:
    ArgumentError: Another number of feeds, or as the class.)");
}

void define_machine_frame(py::module_& module) {
  module.def("machine_frame", &machine_frame, py::arg("tool_frame"), py::arg("direction_rad"),
             "Converts a force (2,) from the frame of the tool to the frame of the machine (paper 001 eq. 4, 5); "
             "`direction_rad`: direction of feed from +X towards +Y.");
}

void define_limits(py::module_& module) {
  py::enum_<FeedLimit>(module, "FeedLimit", "The limit that determines a feed.")
      .value("none", FeedLimit::none, "The highest requested feed is within all limits.")
      .value("resultant", FeedLimit::resultant, "Resultant force, mean or peak.")
      .value("deflection", FeedLimit::deflection, "Peak deflection of the tip.")
      .value("torque", FeedLimit::torque, "Peak torque.")
      .value("power", FeedLimit::power, "Mean power.")
      .value("chip_load", FeedLimit::chip_load, "Feed per tooth or thickest chip.");

  py::class_<FeedLimits>(module, "FeedLimits", "Limits of a feed over one revolution of the spindle; inf: no limit.")
      .def(py::init([](double mean_resultant_n, double peak_resultant_n, double peak_deflection_um,
                       double peak_torque_nm, double mean_power_w, double feed_per_tooth_mm, double peak_chip_mm,
                       const std::optional<ToolBeam>& beam) {
             FeedLimits limits{mean_resultant_n, peak_resultant_n,  peak_deflection_um, peak_torque_nm,
                               mean_power_w,     feed_per_tooth_mm, peak_chip_mm,       beam};
             check(limits);
             return limits;
           }),
           py::kw_only(), py::arg("mean_resultant_n") = FeedLimits::none,
           py::arg("peak_resultant_n") = FeedLimits::none, py::arg("peak_deflection_um") = FeedLimits::none,
           py::arg("peak_torque_nm") = FeedLimits::none, py::arg("mean_power_w") = FeedLimits::none,
           py::arg("feed_per_tooth_mm") = FeedLimits::none, py::arg("peak_chip_mm") = FeedLimits::none,
           py::arg("beam") = py::none(),
           "Raises ArgumentError on a limit that is not positive, or a limit of deflection without a beam.")
      .def_readonly("mean_resultant_n", &FeedLimits::mean_resultant_n, "Mean of the magnitude of the XY force, N.")
      .def_readonly("peak_resultant_n", &FeedLimits::peak_resultant_n, "Largest magnitude, N.")
      .def_readonly("peak_deflection_um", &FeedLimits::peak_deflection_um, "Of the tip, um.")
      .def_readonly("peak_torque_nm", &FeedLimits::peak_torque_nm, "N m.")
      .def_readonly("mean_power_w", &FeedLimits::mean_power_w, "W.")
      .def_readonly("feed_per_tooth_mm", &FeedLimits::feed_per_tooth_mm, "mm.")
      .def_readonly("peak_chip_mm", &FeedLimits::peak_chip_mm, "Thickest chip, mm.")
      .def_readonly("beam", &FeedLimits::beam, "The tool as a beam, or None.");

  py::class_<LimitedFeed>(module, "LimitedFeed", "A feed, and the limit that determines it.")
      .def_readonly("feed_mm_per_min", &LimitedFeed::feed_mm_per_min, "mm/min.")
      .def_readonly("limit", &LimitedFeed::limit, "The limit that is reached first.")
      .def_readonly("within", &LimitedFeed::within, "False: this is the lowest feed, and it exceeds the limit.");
}

void define_largest_feeds(py::module_& module) {
  module.def(
      "largest_feed",
      [](MillingForce& force, const MatrixArray& arcs, const FeedLimits& limits, double lowest, double highest) {
        return largest_feed(force, arcs_from(arcs), limits, lowest, highest);
      },
      py::arg("force"), py::arg("arcs"), py::arg("limits"), py::arg("lowest"), py::arg("highest"),
      "Highest feed between `lowest` and `highest` (mm/min) within all limits: never above a limit, and within 0.02 % "
      "of the limit reached. Raises ArgumentError unless 0 < lowest <= highest.");
  module.def(
      "largest_feeds",
      [](MillingForce& force, const EngagementTrack& track, const FeedLimits& limits, double lowest, double highest) {
        std::vector<LimitedFeed> feeds;
        {
          const py::gil_scoped_release release;
          feeds = largest_feeds(force, track, limits, lowest, highest);
        }
        const auto size = static_cast<py::ssize_t>(feeds.size());
        py::array_t<double> feed(size);
        py::array_t<std::uint8_t> limit(size);
        py::array_t<bool> within(size);
        for (py::ssize_t i = 0; i < size; ++i) {
          const LimitedFeed& at = feeds[static_cast<std::size_t>(i)];
          feed.mutable_at(i) = at.feed_mm_per_min;
          limit.mutable_at(i) = static_cast<std::uint8_t>(at.limit);
          within.mutable_at(i) = at.within;
        }
        return py::make_tuple(feed, limit, within);
      },
      py::arg("force"), py::arg("track"), py::arg("limits"), py::arg("lowest"), py::arg("highest"),
      "largest_feed for every sample of a track, along the path: (feed_mm_per_min, limit as FeedLimit number, within), "
      "each (n_samples,). Without engagement, or if the tool only plunges, the highest feed.");
}

void define_surface(py::module_& module) {
  py::enum_<WallSide>(module, "WallSide", "The wall that a tool finishes beside its path, seen along the feed.")
      .value("right", WallSide::right, "Down milling with a clockwise spindle.")
      .value("left", WallSide::left, "Up milling with a clockwise spindle.");
  module.def(
      "wall_error_um",
      [](MillingForce& force, const ToolBeam& beam, const MatrixArray& arcs, double feed_mm_per_min, WallSide side,
         const VectorArray& height_mm, double tolerance_rad) {
        return wall_error_um(force, beam, arcs_from(arcs), feed_mm_per_min, {side, span_of(height_mm), tolerance_rad});
      },
      py::arg("force"), py::arg("beam"), py::arg("arcs"), py::arg("feed_mm_per_min"), py::arg("side"),
      py::arg("height_mm"), py::arg("tolerance_rad") = wall_tolerance_rad,
      R"(Form error perpendicular to the wall at heights above the tip (paper 001, section 2.3).

Args:
    force: The force model.
    beam: The tool as a beam.
    arcs: (n_arcs, 4): from and to in rad, bottom and top in mm.
    feed_mm_per_min: Along the path.
    side: Which wall.
    height_mm: (n,), mm above the tip.
    tolerance_rad: An arc that ends this close to +-pi/2 reaches the wall.

Returns:
    (n,), um: + material is left, - the wall is cut too deep; NaN where the engagement does not reach it.

Raises:
    ArgumentError: A height below the tip, or an engagement above the overhang.)");
  module.def(
      "wall_errors_um",
      [](MillingForce& force, const ToolBeam& beam, const EngagementTrack& track, const VectorArray& feed_mm_per_min,
         WallSide side, const VectorArray& height_mm, double tolerance_rad) {
        const auto feeds = span_of(feed_mm_per_min);
        const auto heights = span_of(height_mm);
        Eigen::MatrixXd map;
        {
          const py::gil_scoped_release release;
          map = wall_errors_um(force, beam, track, feeds, {side, heights, tolerance_rad});
        }
        return take(std::move(map));
      },
      py::arg("force"), py::arg("beam"), py::arg("track"), py::arg("feed_mm_per_min"), py::arg("side"),
      py::arg("height_mm"), py::arg("tolerance_rad") = wall_tolerance_rad,
      "wall_error_um along a track, with a feed for each sample: (n_samples, n_heights), um, read-only. Raises "
      "ArgumentError as wall_error_um, and on another number of feeds.");
}

}  // namespace

void register_milling(py::module_& module) {
  define_coefficients(module);
  define_beam(module);
  define_figures(module);
  py::class_<MillingForce> force = define_force(module);
  define_force_members(force);
  define_track_figures(force);
  define_machine_frame(module);
  define_limits(module);
  define_largest_feeds(module);
  define_surface(module);
}

}  // namespace shapegcode::bindings
