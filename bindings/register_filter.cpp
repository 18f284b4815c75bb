#include <pybind11/stl.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/filter/fir.hpp"

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
  std::copy_n(position.data(), position.shape(0), out.mutable_data());
  stream.step({out.mutable_data(), static_cast<std::size_t>(position.shape(0))});
  return out;
}

struct PyStream {
  FirStream stream;
  int n_axes;
};

}  // namespace

void register_filter(py::module_& module) {
  py::class_<Fir>(module, "Fir",
                  "Weights on the sample grid that add up to one: an acceleration filter (moving average) or an input "
                  "shaper. One filter type for both (spec section 0).")
      .def(py::init<std::vector<int>, std::vector<double>>(), py::arg("delays"), py::arg("taps"),
           "Taps at whole-sample delays, ascending, adding up to 1. Raises ArgumentError otherwise.")
      .def_static("moving_average", &Fir::moving_average, py::arg("length"),
                  "Equal weights over `length` samples; costs the same for any length. Raises ArgumentError below 1.")
      .def_static("exponential", &Fir::exponential, py::arg("time_constant_samples"), py::arg("rest") = 1e-6,
                  "Geometric weights exp(-k / time_constant), cut off where less than the share `rest` of them is left "
                  "and scaled to a sum of 1; costs the same for any length. Raises ArgumentError on a time constant "
                  "that is not > 0 or a share outside 0 ... 1.")
      .def_property_readonly("delays", &Fir::delays, "Delays in samples.")
      .def_property_readonly("taps", &Fir::taps, "Weights, adding up to 1.")
      .def_property_readonly("duration_samples", &Fir::duration_samples, "Largest delay in samples.")
      .def_property_readonly("mean_samples", &Fir::mean_samples, "Mean delay in samples.")
      .def_property_readonly("variance_samples2", &Fir::variance_samples2,
                             "Second central moment in samples squared: the contour cost.")
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
}

}  // namespace shapegcode::bindings
