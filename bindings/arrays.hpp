// NumPy <-> Eigen at the border: shapes and finiteness are checked here, once.
#pragma once

#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <utility>
#include <variant>

#include "shapegcode/samples.hpp"

namespace shapegcode::bindings {

/// Column-major float64, converted if needed.
using MatrixArray = pybind11::array_t<double, pybind11::array::f_style | pybind11::array::forcecast>;

/// Contiguous float64, converted if needed.
using VectorArray = pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;

/// A number for all axes, or one for each.
using PerAxis = std::variant<double, Vector3>;
[[nodiscard]] Vector3 each_axis(const PerAxis& value);

/// Read-only NumPy view of a matrix that lives as long as `base`.
pybind11::array view(const Eigen::MatrixXd& matrix, pybind11::handle base);

/// Samples from an (n, 3) array; throws ArgumentError on another shape or a value that is not finite.
Samples samples_from(const MatrixArray& positions_mm, double period_s);

/// (n, 3) NumPy array that takes over the matrix without a copy, read-only.
pybind11::array take(Eigen::MatrixXd matrix);

}  // namespace shapegcode::bindings
