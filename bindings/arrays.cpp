#include "arrays.hpp"

#include <string>

#include "shapegcode/error.hpp"

namespace shapegcode::bindings {

Vector3 each_axis(const PerAxis& value) {
  return std::holds_alternative<double>(value) ? Vector3(Vector3::Constant(std::get<double>(value)))
                                               : std::get<Vector3>(value);
}

pybind11::array view(const Eigen::MatrixXd& matrix, pybind11::handle base) {
  constexpr auto stride = static_cast<pybind11::ssize_t>(sizeof(double));
  pybind11::array array(pybind11::dtype::of<double>(), {matrix.rows(), matrix.cols()}, {stride, stride * matrix.rows()},
                        matrix.data(), base);
  pybind11::detail::array_proxy(array.ptr())->flags &= ~pybind11::detail::npy_api::NPY_ARRAY_WRITEABLE_;
  return array;
}

Samples samples_from(const MatrixArray& positions_mm, double period_s) {
  if (positions_mm.ndim() != 2 || positions_mm.shape(1) != axis_count) {
    throw Error(ErrorKind::argument, "positions must have the shape (n_samples, 3)");
  }
  if (!(period_s > 0.0)) {
    throw Error(ErrorKind::argument, "period is " + std::to_string(period_s) + " s, must be finite and above 0");
  }
  Samples samples;
  samples.period_s = period_s;
  samples.positions_mm =
      Eigen::Map<const Eigen::MatrixXd>(positions_mm.data(), positions_mm.shape(0), positions_mm.shape(1));
  if (!samples.positions_mm.allFinite()) {
    throw Error(ErrorKind::argument, "positions hold a value that is not finite");
  }
  return samples;
}

pybind11::array take(Eigen::MatrixXd matrix) {
  auto owned = std::make_unique<Eigen::MatrixXd>(std::move(matrix));
  const Eigen::MatrixXd& reference = *owned;
  const pybind11::capsule owner(owned.release(), [](void* p) { delete static_cast<Eigen::MatrixXd*>(p); });
  return view(reference, owner);
}

}  // namespace shapegcode::bindings
