#include "shapegcode/plant/linear_plant.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "base/checks.hpp"
#include "base/linear_algebra.hpp"
#include "base/rest.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int max_balancing_sweeps = 100;
constexpr double worthwhile = 0.95;  // a scale factor must bring row and column sum at least this far down
constexpr double rest_tolerance = 1e-9;

std::string shape(const MatrixXd& matrix) { return fmt::format("{} x {}", matrix.rows(), matrix.cols()); }

void check_matrix(const char* name, const MatrixXd& matrix, Index rows, Index columns) {
  if (matrix.rows() != rows || matrix.cols() != columns) {
    throw Error(ErrorKind::argument,
                fmt::format("{} of a linear plant is {}, must be {} x {}", name, shape(matrix), rows, columns));
  }
  if (!matrix.allFinite()) {
    throw Error(ErrorKind::argument, fmt::format("{} of a linear plant has a value that is not finite", name));
  }
}

void check_vector(const char* name, const VectorXd& vector, Index size) {
  if (vector.size() != size) {
    throw Error(ErrorKind::argument,
                fmt::format("{} of a linear plant has {} values, must have {}", name, vector.size(), size));
  }
  if (!vector.allFinite()) {
    throw Error(ErrorKind::argument, fmt::format("{} of a linear plant has a value that is not finite", name));
  }
}

/// Powers of two f such that row and column sums of diag(1/f)*matrix*diag(f), without the diagonal, come close
/// together.
VectorXd balance(const MatrixXd& matrix) {
  VectorXd factor = VectorXd::Ones(matrix.rows());
  MatrixXd off = matrix.cwiseAbs();
  off.diagonal().setZero();
  bool changed = true;
  for (int sweep = 0; changed && sweep < max_balancing_sweeps; ++sweep) {
    changed = false;
    for (Index i = 0; i < off.rows(); ++i) {
      const double column = off.col(i).sum();
      const double row = off.row(i).sum();
      if (!(column > 0.0 && row > 0.0)) continue;
      const double scale = std::exp2(std::round(0.5 * (std::log2(row) - std::log2(column))));
      if (column * scale + row / scale >= worthwhile * (column + row)) continue;
      off.col(i) *= scale;
      off.row(i) /= scale;
      factor[i] *= scale;
      changed = true;
    }
  }
  return factor;
}

/// exp(matrix) - 1, by scaling and squaring with the Pade approximant of order 13 (Higham 2005, algorithm 2.3). The 1
/// is kept apart while squaring, (1 + p)^2 - 1 = 2p + p^2: beside a stiff part, what moves slowly would be rounded away
/// by it, and an integrator's row of zeros stays zero.
MatrixXd exponential_less_one(const MatrixXd& matrix) {
  constexpr double largest_norm = 5.371920351148152;  // up to which the approximant is exact to rounding
  constexpr std::array<double, 14> pade{64764752532480000.0,
                                        32382376266240000.0,
                                        7771770303897600.0,
                                        1187353796428800.0,
                                        129060195264000.0,
                                        10559470521600.0,
                                        670442572800.0,
                                        33522128640.0,
                                        1323241920.0,
                                        40840800.0,
                                        960960.0,
                                        16380.0,
                                        182.0,
                                        1.0};
  const double norm = matrix.cwiseAbs().colwise().sum().maxCoeff();
  const int halvings = norm > largest_norm ? static_cast<int>(std::ceil(std::log2(norm / largest_norm))) : 0;
  const MatrixXd one = MatrixXd::Identity(matrix.rows(), matrix.cols());
  const MatrixXd a1 = matrix * std::exp2(-halvings);
  const MatrixXd a2 = a1 * a1;
  const MatrixXd a4 = a2 * a2;
  const MatrixXd a6 = a4 * a2;
  const auto upper = [&](std::size_t k) -> MatrixXd {
    return a6 * (pade[k] * a6 + pade[k - 2] * a4 + pade[k - 4] * a2) + pade[k - 6] * a6 + pade[k - 8] * a4 +
           pade[k - 10] * a2 + pade[k - 12] * one;
  };
  const MatrixXd odd = a1 * upper(13);
  MatrixXd result = linear_algebra::solve(upper(12) - odd, MatrixXd(2.0 * odd));
  for (int k = 0; k < halvings; ++k) result = (2.0 * result + result * result).eval();
  return result;
}

}  // namespace

MatrixXd matrix_exponential(const MatrixXd& matrix) {
  if (matrix.rows() != matrix.cols() || !matrix.allFinite()) {
    throw Error(ErrorKind::argument,
                fmt::format("exponential of a matrix of {} values, it must be square and finite", shape(matrix)));
  }
  if (matrix.size() == 0) return matrix;
  const VectorXd factor = balance(matrix);
  const VectorXd inverse = factor.cwiseInverse();  // powers of two: exact
  const MatrixXd balanced = inverse.asDiagonal() * matrix * factor.asDiagonal();
  MatrixXd result = factor.asDiagonal() * exponential_less_one(balanced) * inverse.asDiagonal();
  result.diagonal().array() += 1.0;
  if (!result.allFinite()) throw Error(ErrorKind::numeric, "exponential of a matrix exceeds all numbers");
  return result;
}

HeldPeriod first_order_hold(const MatrixXd& a, const MatrixXd& b, double period_s) {
  const Index states = a.rows();
  const Index inputs = b.cols();
  check_matrix("A", a, states, states);
  check_matrix("B", b, states, inputs);
  require_period(period_s, "period of a linear plant");
  MatrixXd joint = MatrixXd::Zero(states + 2 * inputs, states + 2 * inputs);
  joint.topLeftCorner(states, states) = a * period_s;
  joint.block(0, states, states, inputs) = b * period_s;
  joint.block(states, states + inputs, inputs, inputs).setIdentity();
  const MatrixXd all = matrix_exponential(joint);
  const MatrixXd constant = all.block(0, states, states, inputs);
  const MatrixXd ramp = all.block(0, states + inputs, states, inputs);
  return {all.topLeftCorner(states, states), constant - ramp, ramp};
}

LinearPlant::LinearPlant(StateSpace plant, double period_s) : plant_(std::move(plant)), period_s_(period_s) {
  const Index states = order();
  if (states == 0 || inputs() == 0 || outputs() == 0) {
    throw Error(ErrorKind::argument,
                fmt::format("a linear plant of {} states, {} inputs and {} outputs, at least one of each needed",
                            states, inputs(), outputs()));
  }
  const HeldPeriod held = first_order_hold(plant_.a, plant_.b, period_s);
  check_matrix("C", plant_.c, outputs(), states);
  check_matrix("D", plant_.d, outputs(), inputs());
  over_period_.resize(states, states + 2 * inputs());
  over_period_ << held.state, held.from_input, held.to_input;
  joint_ = VectorXd::Zero(states + 2 * inputs());
  next_ = VectorXd::Zero(states);
  output_ = VectorXd::Zero(outputs());
}

void LinearPlant::reset(const VectorXd& state, const VectorXd& input) {
  check_vector("state", state, order());
  check_vector("input", input, inputs());
  joint_.head(order()) = state;
  joint_.segment(order(), inputs()) = input;
  output_.noalias() = plant_.c * state + plant_.d * input;
  row_ = 0;
}

void LinearPlant::reset_at_rest(const VectorXd& input) { reset_at_rest(input, VectorXd::Zero(order())); }

void LinearPlant::reset_at_rest(const VectorXd& input, const VectorXd& near) {
  check_vector("input", input, inputs());
  check_vector("state", near, order());
  // Balanced, and every equation by its largest coefficient: all terms have one unit, that of the balanced state.
  const VectorXd factor = balance(plant_.a);
  MatrixXd equations = plant_.a * factor.asDiagonal();
  VectorXd largest = equations.cwiseAbs().rowwise().maxCoeff();
  for (double& value : largest) value = value > 0.0 ? value : 1.0;
  equations = largest.cwiseInverse().asDiagonal() * equations;
  const VectorXd from = near.cwiseQuotient(factor);
  const VectorXd missing = -(equations * from + (plant_.b * input).cwiseQuotient(largest));
  const VectorXd away = linear_algebra::least_norm_solution(equations, missing);
  const VectorXd terms = equations.cwiseAbs() * (from.cwiseAbs() + away.cwiseAbs()) +
                         (plant_.b.cwiseAbs() * input.cwiseAbs()).cwiseQuotient(largest);
  Index worst = 0;
  const double left = (equations * away - missing).cwiseAbs().maxCoeff(&worst);
  if (!(left <= rest_tolerance * terms.maxCoeff())) {
    throw Error(ErrorKind::argument,
                fmt::format("no state of the linear plant rests under this input: state {} drifts by {:.6g} per second",
                            worst, left * largest[worst]));
  }
  const VectorXd state = factor.asDiagonal() * (from + away);
  reset(state, input);
}

void LinearPlant::step(std::span<const double> in, std::span<double> out) noexcept {
  const Index states = order();
  const Eigen::Map<const VectorXd> input(in.data(), inputs());
  joint_.tail(inputs()) = input;
  next_.noalias() = over_period_ * joint_;
  if (++row_ % rows_between_looks == 0) {
    for (double& value : next_) value = state_or_none(value);
  }
  joint_.head(states) = next_;
  joint_.segment(states, inputs()) = input;
  output_.noalias() = plant_.c * next_;
  output_.noalias() += plant_.d * input;
  std::copy_n(output_.data(), outputs(), out.begin());
}

void LinearPlant::check_inputs(const MatrixXd& inputs_of_run) const {
  if (inputs_of_run.rows() == 0 || inputs_of_run.cols() != inputs()) {
    throw Error(
        ErrorKind::argument,
        fmt::format("inputs of a linear plant are {} values, must be one row per sample, at least one, and {} columns",
                    shape(inputs_of_run), inputs()));
  }
  if (!inputs_of_run.allFinite()) {
    throw Error(ErrorKind::argument, "inputs of a linear plant have a value that is not finite");
  }
}

MatrixXd LinearPlant::run(const MatrixXd& inputs_of_run) {
  MatrixXd result(inputs_of_run.rows(), outputs());
  result.row(0) = output_;
  const MatrixXd by_sample = inputs_of_run.transpose();
  const auto values = static_cast<std::size_t>(inputs());
  VectorXd output(outputs());
  for (Index k = 1; k < by_sample.cols(); ++k) {
    step({by_sample.col(k).data(), values}, {output.data(), static_cast<std::size_t>(output.size())});
    result.row(k) = output;
  }
  return result;
}

MatrixXd LinearPlant::respond(const MatrixXd& inputs_of_run) {
  check_inputs(inputs_of_run);
  reset_at_rest(inputs_of_run.row(0).transpose());
  return run(inputs_of_run);
}

MatrixXd LinearPlant::respond(const MatrixXd& inputs_of_run, const VectorXd& state) {
  check_inputs(inputs_of_run);
  reset(state, inputs_of_run.row(0).transpose());
  return run(inputs_of_run);
}

}  // namespace shapegcode
