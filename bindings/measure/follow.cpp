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
                           "By how much, and in which direction, a table leaves the path that its command follows.")
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
          "The next samples of both, (k, 3), mm: from foot on the path to response, (k, 3), mm. Raises ArgumentError "
          "on "
          "other shapes or values that are not finite.");
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
      R"(Fewer samples of curves over time, which look the same (Douglas and Peucker 1973, distance along the value).

Args:
    times: Of the rows, (n,), rising.
    values: Samples of the curves, (n, curves).
    tolerances: How far each curve may be from a straight line between two kept samples, (curves,), above 0.

Returns:
    Which rows remain, rising, the first and the last among them, (k,).

Raises:
    ArgumentError: Another shape, times that do not rise, a tolerance that is not above 0, or a value that is not finite.)");
}

}  // namespace shapegcode::bindings
