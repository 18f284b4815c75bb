#include <pybind11/stl.h>

#include <memory>
#include <vector>

#include "arrays.hpp"
#include "register.hpp"
#include "shapegcode/measure/follow.hpp"

namespace py = pybind11;

namespace shapegcode::bindings {

void register_follow(py::module_& module) {
  py::class_<PathFollower>(module, "PathFollower",
                           "Deviation vectors of a response from the path that its command follows.")
      .def(py::init([](const std::shared_ptr<Path>& path) { return std::make_unique<PathFollower>(*path); }),
           py::arg("path").none(false), "Raises ArgumentError on a path without segments.")
      .def(
          "step",
          [](PathFollower& self, const MatrixArray& command_mm, const MatrixArray& response_mm) {
            const Samples command = samples_from(command_mm, 1.0);
            const Samples response = samples_from(response_mm, 1.0);
            const py::gil_scoped_release release;
            return self.step(command.positions_mm, response.positions_mm);
          },
          py::arg("command_mm"), py::arg("response_mm"),
          "Takes the next samples of command and response, (k, 3), mm. Returns the vectors from the foot on the path "
          "to the response, (k, 3), mm. Raises ArgumentError on other or unequal shapes, or values that are not "
          "finite.");
  module.def(
      "thin_curves",
      [](const Eigen::VectorXd& times, const Eigen::Ref<const Eigen::MatrixXd>& values,
         const Eigen::VectorXd& tolerances) {
        std::vector<std::size_t> kept;
        {
          const py::gil_scoped_release release;
          kept = thin_curves(times, values, tolerances);
        }
        return py::array_t<std::int64_t>(py::array(py::cast(kept)));
      },
      py::arg("times"), py::arg("values"), py::arg("tolerances"),
      R"(Selects the samples needed for curves to look the same (Douglas and Peucker 1973, distance along the value).

Args:
    times: Times of the rows, (n,), rising.
    values: Samples of the curves, (n, curves).
    tolerances: Permitted distance of each curve from straight lines between selected samples, (curves,), above 0.

Returns:
    Indices of the selected rows, ascending, including the first and the last, (k,).

Raises:
    ArgumentError: Another shape, times that do not rise, a tolerance not above 0, or a value that is not finite.)");
}

}  // namespace shapegcode::bindings
