#include <pybind11/eigen.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/linear_plant.hpp"
#include "shapegcode/plant/modal.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {
namespace {

ModeTable checked_table(int axis, std::vector<double> position_mm, std::vector<double> frequency_hz,
                        std::vector<double> damping_ratio) {
  ModeTable table{axis, std::move(position_mm), std::move(frequency_hz), std::move(damping_ratio)};
  check_table(table);
  return table;
}

Eigen::VectorXd stepped(LinearPlant& plant, const Eigen::VectorXd& input) {
  if (input.size() != plant.inputs() || !input.allFinite()) {
    throw Error(ErrorKind::argument, "input of a linear plant of " + std::to_string(plant.inputs()) +
                                         " inputs must be as many finite values, got " + std::to_string(input.size()));
  }
  Eigen::VectorXd output(plant.outputs());
  plant.step({input.data(), static_cast<std::size_t>(input.size())},
             {output.data(), static_cast<std::size_t>(output.size())});
  return output;
}

py::array response(LinearPlant& plant, const Eigen::MatrixXd& inputs, const std::optional<Eigen::VectorXd>& state) {
  Eigen::MatrixXd outputs;
  {
    const py::gil_scoped_release release;
    outputs = state ? plant.respond(inputs, *state) : plant.respond(inputs);
  }
  return take(std::move(outputs));
}

void register_linear_plant(py::module_& module) {
  py::class_<LinearPlant>(module, "LinearPlant",
                          R"(A linear plant x' = A x + B u, y = C x + D u, propagated exactly from sample to sample.

The input is linear between samples (first-order hold), as a servo's set-points are. The matrix exponential propagates
the state over a period, so stiff, undamped and integrating plants are as exact as any other. Any consistent units, time
in s.

Args:
    a: System matrix, (n, n).
    b: Input matrix, (n, m).
    c: Output matrix, (p, n).
    d: Feed-through, (p, m).
    period_s: Time between samples in s, above 0.

Raises:
    ArgumentError: Shapes that do not fit, an empty one, a value that is not finite, or a period not above 0.
    NumericError: The plant overflows within a period.)")
      .def(py::init([](Eigen::MatrixXd a, Eigen::MatrixXd b, Eigen::MatrixXd c, Eigen::MatrixXd d, double period_s) {
             return LinearPlant({std::move(a), std::move(b), std::move(c), std::move(d)}, period_s);
           }),
           py::arg("a"), py::arg("b"), py::arg("c"), py::arg("d"), py::arg("period_s"),
           "Make a plant, at rest with state and input 0.")
      .def("reset", &LinearPlant::reset, py::arg("state"), py::arg("input"),
           "Sets the state (n,) and the input (m,) at that instant. Raises ArgumentError on another shape.")
      .def(
          "reset_at_rest",
          [](LinearPlant& self, const Eigen::VectorXd& input, const std::optional<Eigen::VectorXd>& near) {
            near ? self.reset_at_rest(input, *near) : self.reset_at_rest(input);
          },
          py::arg("input"), py::arg("near") = py::none(),
          R"(Sets the steady state under a constant input.

Args:
    input: Input, (m,).
    near: If integrators leave the state undetermined, the steady state nearest to this one, (n,); None: nearest to 0.

Raises:
    ArgumentError: There is no steady state (the input makes an integrator grow), or another shape.)")
      .def("step", &stepped, py::arg("input"),
           "Advances by a period, with `input` (m,) at its end. Returns the output (p,) there.")
      .def("respond", &response, py::arg("inputs"), py::arg("state") = py::none(),
           R"(Outputs for a whole record of inputs; identical to step(), to the last bit.

Args:
    inputs: One row per sample, (n_samples, m), at least one row.
    state: State at the first row, (n,); None: at rest under the first row.

Returns:
    Output at each row, (n_samples, p).

Raises:
    ArgumentError: Another shape, a value that is not finite, or no steady state.)")
      .def_property_readonly("state", &LinearPlant::state, "State at the last sample, (n,).")
      .def_property_readonly("output", &LinearPlant::output, "Output at the last sample, (p,).")
      .def_property_readonly("period_s", &LinearPlant::period_s, "Time between samples in s.");
  module.def("matrix_exponential", &matrix_exponential, py::arg("matrix"),
             R"(Matrix exponential, balanced, by scaling and squaring.

Raises:
    ArgumentError: Not square or not finite.
    NumericError: The result overflows.)");
}

// NumPy owns the result, in the memory order of the command.
py::array_t<double> modal_response(const py::array_t<double, py::array::forcecast>& command_mm,
                                   const std::vector<std::vector<Mode>>& modes, double period_s) {
  ModalResponse plant(modes, period_s);
  if (command_mm.ndim() != 2) throw Error(ErrorKind::argument, "command must have the shape (n_samples, n_axes)");
  constexpr auto size = static_cast<py::ssize_t>(sizeof(double));
  const py::ssize_t rows = command_mm.shape(0);
  const py::ssize_t columns = command_mm.shape(1);
  const bool by_row = (command_mm.flags() & py::array::c_style) != 0;
  py::array_t<double> response({rows, columns}, {by_row ? size * columns : size, by_row ? size : size * rows});
  const auto stride = [](const py::array& array) {
    return Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>(array.strides(1) / size, array.strides(0) / size);
  };
  using Matrix = Eigen::Map<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  using MutableMatrix = Eigen::Map<Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  const Matrix command(command_mm.data(), rows, columns, stride(command_mm));
  MutableMatrix result(response.mutable_data(), rows, columns, stride(response));
  {
    const py::gil_scoped_release release;
    plant.apply(command, result);
  }
  return response;
}

}  // namespace

void register_plant(py::module_& module) {
  module.def("plant_response", &modal_response, py::arg("command_mm"), py::arg("modes"), py::arg("period_s"),
             R"(Response of base-excited modes to a whole record of set-points, exact for set-points linear in between.

Identical to the real-time plant of the core, to the last bit, but computed as a batch. The plant is at rest at the
first row.

Args:
    command_mm: Set-points in mm, shape (n_samples, n_axes), one per period.
    modes: The modes of each axis; none: the axis follows its command.
    period_s: Time between samples in s, above 0.

Returns:
    Positions of the table in mm at the same instants, (n_samples, n_axes), in the memory order of the command.

Raises:
    ArgumentError: Not as many lists of modes as axes, a command that is not finite, an invalid mode or period.)");
  register_linear_plant(module);
  py::class_<ModeTable>(module, "ModeTable", R"(Dependence of a mode on the position of an axis. Immutable.

Frequency and damping ratio are linear between the rows and constant beyond the ends; without rows the mode is constant.

Args:
    axis: Axis of the position: 0, 1, 2 for X, Y, Z.
    position_mm: Strictly ascending positions in mm, shape (n,).
    frequency_hz: Undamped natural frequencies in Hz, one per position, above 0.
    damping_ratio: Damping ratios (no unit), one per position, 0 <= zeta < 1; none: that of the mode.

Raises:
    ArgumentError: Unequal lengths, positions that do not ascend, or a value outside its range.)")
      .def(py::init(&checked_table), py::arg("axis") = 0, py::arg("position_mm") = std::vector<double>{},
           py::arg("frequency_hz") = std::vector<double>{}, py::arg("damping_ratio") = std::vector<double>{},
           "Raises ArgumentError on a value outside its range.")
      .def_readonly("axis", &ModeTable::axis, "Axis of the position.")
      .def_readonly("position_mm", &ModeTable::position_mm, "Positions in mm.")
      .def_readonly("frequency_hz", &ModeTable::frequency_hz, "Frequencies in Hz.")
      .def_readonly("damping_ratio", &ModeTable::damping_ratio, "Damping ratios, or none.")
      .def(
          "mode_at",
          [](const ModeTable& self, const Mode& mode, double position_mm) { return mode_at(mode, self, position_mm); },
          py::arg("mode"), py::arg("position_mm"), "Mode at a position (mm) of the axis, with the same participation.");
}

}  // namespace shapegcode::bindings
