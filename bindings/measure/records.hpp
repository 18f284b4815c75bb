// What the bindings of identification share: records in, arrays out.
#pragma once

#include <pybind11/complex.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/typing.h>

#include <complex>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "arrays.hpp"
#include "shapegcode/identify/arma.hpp"
#include "shapegcode/identify/modal_fit.hpp"

namespace shapegcode::bindings {

using RealArray = pybind11::array_t<double>;
using ComplexArray = pybind11::array_t<std::complex<double>>;

/// Throws ArgumentError unless the array is one-dimensional.
std::span<const double> span_of(const VectorArray& values, const char* what);
std::vector<std::span<const double>> spans_of(const std::vector<VectorArray>& records, const char* what);
/// Throws ArgumentError unless there are as many forces as responses.
std::vector<TapSignals> taps_of(const std::vector<VectorArray>& forces, const std::vector<VectorArray>& responses);
NaturalModes modes_of(const VectorArray& omega_rad_s, const VectorArray& damping_ratio);

Quantity quantity_of(const std::string& name);
ForceHold hold_of(const std::string& name);

/// Read-only copies.
RealArray array_of(const std::vector<double>& values);
RealArray array_of(const Eigen::VectorXd& values);
ComplexArray array_of(const std::vector<std::complex<double>>& values);

// One for each source; all behind register_identification.
void register_arma(pybind11::module_& module);
void register_modal_fits(pybind11::module_& module);
void register_decay_fits(pybind11::module_& module);
void register_ranking(pybind11::module_& module);
void register_equivalent_mass(pybind11::module_& module);

}  // namespace shapegcode::bindings
