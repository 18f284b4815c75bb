#include "measure/records.hpp"

#include "shapegcode/error.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

template <typename Scalar>
py::array_t<Scalar> read_only_copy(const Scalar* values, std::size_t size) {
  py::array_t<Scalar> array(static_cast<py::ssize_t>(size), values);
  array.attr("flags").attr("writeable") = false;
  return array;
}

}  // namespace

std::span<const double> span_of(const VectorArray& values, const char* what) {
  if (values.ndim() != 1) {
    throw Error(ErrorKind::argument,
                std::string(what) + " must be one-dimensional, has " + std::to_string(values.ndim()) + " dimensions");
  }
  return {values.data(), static_cast<std::size_t>(values.size())};
}

std::vector<std::span<const double>> spans_of(const std::vector<VectorArray>& records, const char* what) {
  std::vector<std::span<const double>> spans;
  spans.reserve(records.size());
  for (const VectorArray& record : records) spans.push_back(span_of(record, what));
  return spans;
}

std::vector<TapSignals> taps_of(const std::vector<VectorArray>& forces, const std::vector<VectorArray>& responses) {
  if (forces.size() != responses.size()) {
    throw Error(ErrorKind::argument, std::to_string(forces.size()) + " records of force and " +
                                         std::to_string(responses.size()) + " of response: as many needed");
  }
  std::vector<TapSignals> taps;
  for (std::size_t r = 0; r < forces.size(); ++r) {
    taps.push_back({span_of(forces[r], "force"), span_of(responses[r], "response")});
  }
  return taps;
}

Quantity quantity_of(const std::string& name) {
  if (name == "acceleration") return Quantity::acceleration;
  if (name == "velocity") return Quantity::velocity;
  if (name == "displacement") return Quantity::displacement;
  throw Error(ErrorKind::argument, "quantity is '" + name + "', must be 'acceleration', 'velocity' or 'displacement'");
}

ForceHold hold_of(const std::string& name) {
  if (name == "linear") return ForceHold::linear;
  if (name == "band_limited") return ForceHold::band_limited;
  if (name == "impulse") return ForceHold::impulse;
  throw Error(ErrorKind::argument, "hold is '" + name + "', must be 'linear', 'band_limited' or 'impulse'");
}

NaturalModes modes_of(const VectorArray& omega_rad_s, const VectorArray& damping_ratio) {
  const auto omega = span_of(omega_rad_s, "natural frequencies");
  const auto zeta = span_of(damping_ratio, "damping ratios");
  return {{omega.begin(), omega.end()}, {zeta.begin(), zeta.end()}};
}

RealArray array_of(const std::vector<double>& values) { return read_only_copy(values.data(), values.size()); }

RealArray array_of(const Eigen::VectorXd& values) {
  return read_only_copy(values.data(), static_cast<std::size_t>(values.size()));
}

ComplexArray array_of(const std::vector<std::complex<double>>& values) {
  return read_only_copy(values.data(), values.size());
}

}  // namespace shapegcode::bindings
