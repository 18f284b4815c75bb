#include <pybind11/stl.h>

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/filter.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

// NumPy owns the output: one pass from input to result, in the memory order of the input.
py::array_t<double> apply(const Fir& fir, const py::array_t<double, py::array::forcecast>& samples) {
  if (samples.ndim() != 1 && samples.ndim() != 2) {
    throw Error(ErrorKind::argument, "samples must have the shape (n_samples,) or (n_samples, n_axes)");
  }
  const py::ssize_t rows = samples.shape(0);
  const py::ssize_t columns = samples.ndim() == 2 ? samples.shape(1) : 1;
  const py::ssize_t out_rows = rows + fir.duration_samples();
  constexpr auto size = static_cast<py::ssize_t>(sizeof(double));
  if (samples.ndim() == 2 && (samples.flags() & py::array::c_style) != 0) {
    py::array_t<double> out({out_rows, columns});
    double* to = out.mutable_data();
    const py::gil_scoped_release release;
    fir.apply_rows(samples.data(), rows, static_cast<int>(columns), to);
    return out;
  }
  const MatrixArray by_column(samples);
  py::array_t<double> out = samples.ndim() == 1 ? py::array_t<double>(out_rows)
                                                : py::array_t<double>({out_rows, columns}, {size, size * out_rows});
  double* to = out.mutable_data();
  {
    const py::gil_scoped_release release;
    fir.apply(by_column.data(), rows, static_cast<int>(columns), to);
  }
  return out;
}

py::array_t<double> stream_step(FirStream& stream, const py::array_t<double, py::array::forcecast>& position,
                                int n_axes) {
  if (position.ndim() != 1 || position.shape(0) != n_axes) {
    throw Error(ErrorKind::argument, "position must have the shape (n_axes,)");
  }
  py::array_t<double> out(position.shape(0));
  const auto axes = static_cast<std::size_t>(n_axes);
  stream.step({position.data(), axes}, {out.mutable_data(), axes});
  return out;
}

struct PyStream {
  FirStream stream;
  int n_axes;
};

/// Samples of any number of axes; what is not finite would stay in a running sum.
Samples any_samples(const MatrixArray& positions_mm) {
  if (positions_mm.ndim() != 2) {
    throw Error(ErrorKind::argument, "samples must have the shape (n_samples, n_axes)");
  }
  Samples samples;
  samples.positions_mm =
      Eigen::Map<const Eigen::MatrixXd>(positions_mm.data(), positions_mm.shape(0), positions_mm.shape(1));
  if (!samples.positions_mm.allFinite()) throw Error(ErrorKind::argument, "a sample is not finite");
  return samples;
}

struct PyVaryingStream {
  VaryingFirStream stream;
  std::size_t n_axes;
};

void register_varying(py::module_& module) {
  py::class_<VaryingFir>(module, "VaryingFir", R"(A set of filters on one grid, with a varying choice among them.

Each increment of the input is replaced by the whole impulse train of the filter that its place selects (scatter form),
so that every increment keeps the zeros of its own filter, however often the filters change. Place k is filter k of the
set; place k + w (0 < w < 1) gives the part 1 - w of an increment to filter k and w to filter k + 1.

Args:
    set: The filters (Fir), at least one.

Raises:
    ArgumentError: An empty set.)")
      .def(py::init<std::vector<Fir>>(), py::arg("set"), "Raises ArgumentError if the set is empty.")
      .def_property_readonly("set", &VaryingFir::set, "The filters.")
      .def_property_readonly("duration_samples", &VaryingFir::duration_samples, "Largest delay in samples.")
      .def_property_readonly("mean_samples", &VaryingFir::mean_samples, "Mean delay, average of the set, in samples.")
      .def_property_readonly("variance_samples2", &VaryingFir::variance_samples2,
                             "Largest second central moment of the set in samples squared.")
      .def("on_finer_grid", &VaryingFir::on_finer_grid, py::arg("factor"),
           "The same set on a grid `factor` times as fine. Raises ArgumentError below 1.")
      .def(
          "apply",
          [](const VaryingFir& self, const MatrixArray& samples, const std::vector<double>& place) {
            const Samples in = any_samples(samples);
            Samples out;
            {
              const py::gil_scoped_release release;
              out = self.apply(in, place);
            }
            return take(std::move(out.positions_mm));
          },
          py::arg("samples"), py::arg("place"),
          "Filter samples (n, n_axes); `place` (n,) for the increment that leads to each sample. The result has "
          "duration_samples more rows. Bit-identical to VaryingFirStream. Raises ArgumentError on another shape or a "
          "value that is not finite.");

  py::class_<PyVaryingStream>(module, "VaryingFirStream", "Real-time form of VaryingFir: one sample per step.")
      .def(py::init([](const VaryingFir& fir, int n_axes) {
             return PyVaryingStream{VaryingFirStream(fir, n_axes), static_cast<std::size_t>(n_axes)};
           }),
           py::arg("fir"), py::arg("n_axes"), "At rest at zero. Raises ArgumentError on n_axes < 1.")
      .def(
          "reset",
          [](PyVaryingStream& self, const std::vector<double>& position) {
            if (position.size() != self.n_axes) {
              throw Error(ErrorKind::argument, "position must have n_axes values");
            }
            self.stream.reset(position);
          },
          py::arg("position"), "Rest at `position`, shape (n_axes,).")
      .def(
          "step",
          [](PyVaryingStream& self, std::vector<double> position, double place) {
            if (position.size() != self.n_axes) {
              throw Error(ErrorKind::argument, "position must have n_axes values");
            }
            self.stream.step(position, position, place);
            return position;
          },
          py::arg("position"), py::arg("place"), "Filtered sample, n_axes values.");

  py::class_<FollowingFir>(module, "FollowingFir", R"(A set of filters along an axis, whose position selects the filter.

Filter k of the set is valid where the axis is at position k; between two positions each increment is divided between
their filters, beyond the ends the nearest filter is valid. The middle of each increment selects its filter.

Args:
    fir: The set.
    axis: 0, 1, 2 for X, Y, Z.
    position_mm: Strictly ascending, one per filter, mm.

Raises:
    ArgumentError: No such axis, another number of positions, or positions that do not ascend.)")
      .def(py::init<VaryingFir, int, std::vector<double>>(), py::arg("fir"), py::arg("axis"), py::arg("position_mm"),
           "Raises ArgumentError if axis or positions do not fit.")
      .def_property_readonly("fir", &FollowingFir::fir, "The set.")
      .def_property_readonly("axis", &FollowingFir::axis, "Axis whose position selects the filter.")
      .def_property_readonly("position_mm", &FollowingFir::position_mm, "Positions of the filters, mm.")
      .def("place", &FollowingFir::place, py::arg("position_mm"), "Place in the set for a position (mm) of the axis.")
      .def("on_finer_grid", &FollowingFir::on_finer_grid, py::arg("factor"),
           "The same on a grid `factor` times as fine. Raises ArgumentError below 1.")
      .def(
          "apply",
          [](const FollowingFir& self, const MatrixArray& samples) {
            const Samples in = any_samples(samples);
            Samples out;
            {
              const py::gil_scoped_release release;
              out = self.apply(in);
            }
            return take(std::move(out.positions_mm));
          },
          py::arg("samples"),
          "Filter samples (n, n_axes) in mm; the result has fir.duration_samples more rows. Raises ArgumentError on "
          "another shape, no sample, a value that is not finite, or samples without the axis.");
}

}  // namespace

void register_filter(py::module_& module) {
  py::class_<Fir>(module, "Fir",
                  "Weights on the sample grid that add up to one: an acceleration filter (moving average) or an input "
                  "shaper. One filter type for both.")
      .def(py::init<std::vector<int>, std::vector<double>>(), py::arg("delays"), py::arg("taps"),
           "Taps at whole-sample delays, ascending, adding up to 1. Raises ArgumentError otherwise.")
      .def_static("moving_average", &Fir::moving_average, py::arg("length"),
                  "Equal weights over `length` samples; costs the same for any length. Raises ArgumentError below 1.")
      .def_static("exponential", &Fir::exponential, py::arg("time_constant_samples"), py::arg("rest") = 1e-6,
                  "Geometric weights exp(-k / time_constant), cut off where less than the ratio `rest` of their sum "
                  "remains and scaled to a sum of 1; costs the same for any length. Raises ArgumentError on a time "
                  "constant that is not > 0 or a ratio outside 0 ... 1.")
      .def_property_readonly("delays", &Fir::delays, "Delays in samples.")
      .def_property_readonly("taps", &Fir::taps, "Weights, adding up to 1.")
      .def_property_readonly("duration_samples", &Fir::duration_samples, "Largest delay in samples.")
      .def_property_readonly("mean_samples", &Fir::mean_samples, "Mean delay in samples.")
      .def_property_readonly("variance_samples2", &Fir::variance_samples2,
                             "Second central moment in samples squared; on a circle dR/R = variance*(v/R)^2/2.")
      .def("apply", &apply, py::arg("samples"),
           "Filter samples of shape (n,) or (n, n_axes); the result has duration_samples more rows. The input is held "
           "at "
           "its first value before and at its last value after. Bit-identical to FirStream. Raises ArgumentError on "
           "another shape.")
      .def("__repr__", [](const Fir& fir) {
        return "<Fir " + std::to_string(fir.taps().size()) + " taps, " + std::to_string(fir.duration_samples()) +
               " samples>";
      });

  py::class_<PyStream>(module, "FirStream", "Real-time form of Fir: one sample of every axis per step.")
      .def(py::init([](const Fir& fir, int n_axes) {
             return PyStream{FirStream(fir, n_axes), n_axes};
           }),
           py::arg("fir"), py::arg("n_axes"), "At rest at zero. Raises ArgumentError on n_axes < 1.")
      .def(
          "reset",
          [](PyStream& self, const std::vector<double>& position) {
            if (static_cast<int>(position.size()) != self.n_axes) {
              throw Error(ErrorKind::argument, "position must have n_axes values");
            }
            self.stream.reset(position);
          },
          py::arg("position"), "Rest at `position`, shape (n_axes,).")
      .def(
          "step",
          [](PyStream& self, const VectorArray& position) { return stream_step(self.stream, position, self.n_axes); },
          py::arg("position"), "Filtered sample, shape (n_axes,).");

  register_varying(module);
}

}  // namespace shapegcode::bindings
