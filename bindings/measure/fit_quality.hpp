// What the classes of all fits tell.
#pragma once

#include "measure/records.hpp"

namespace shapegcode::bindings {

/// Read-only properties that every fit has.
template <typename Fit>
void add_quality(pybind11::class_<Fit>& type) {
  type.def_property_readonly(
          "sum_of_squares", [](const Fit& self) { return self.quality.sum_of_squares; },
          "Sum of the squared residuals, in the response's unit squared.")
      .def_property_readonly(
          "log_likelihood", [](const Fit& self) { return self.quality.log_likelihood; },
          "Logarithm of the likelihood, for white normal residuals of the same variance in all records.")
      .def_property_readonly(
          "samples", [](const Fit& self) { return self.quality.samples; }, "Samples of all records together.")
      .def_property_readonly(
          "parameters", [](const Fit& self) { return self.quality.parameters; },
          "Fitted parameters, offsets and amplitudes included.")
      .def_property_readonly(
          "residual_autocorrelation", [](const Fit& self) { return self.quality.residual_autocorrelation; },
          "Autocorrelation of the residuals at a lag of one sample, no unit; about 0 where they are white.")
      .def_property_readonly(
          "residual_rms", [](const Fit& self) { return array_of(self.quality.residual_rms); },
          "RMS of the residuals per record, shape (records,), in the response's unit.")
      .def_property_readonly(
          "fitted",
          [](const Fit& self) {
            pybind11::typing::List<RealArray> records;
            for (const Eigen::VectorXd& record : self.quality.fitted) records.append(array_of(record));
            return records;
          },
          "Response of the model per record, each of shape (n,), offset included.")
      .def_property_readonly(
          "iterations", [](const Fit& self) { return self.quality.iterations; }, "Steps of the search.")
      .def_property_readonly(
          "converged", [](const Fit& self) { return self.quality.converged; }, "True if a minimum was reached.")
      .def_property_readonly(
          "reason", [](const Fit& self) { return self.quality.reason; }, "Why it has not converged; else empty.")
      .def_property_readonly(
          "omega_rad_s", [](const Fit& self) { return array_of(self.omega_rad_s); },
          "Undamped natural frequencies in rad/s, shape (n,), in the order of the starts.")
      .def_property_readonly(
          "damping_ratio", [](const Fit& self) { return array_of(self.damping_ratio); },
          "Damping ratios, no unit, shape (n,).")
      .def_property_readonly(
          "offset", [](const Fit& self) { return array_of(self.offset); },
          "Offset per record, shape (records,), in the response's unit.");
}

}  // namespace shapegcode::bindings
