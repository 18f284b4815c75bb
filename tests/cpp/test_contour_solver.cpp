#include <doctest/doctest.h>

#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <span>
#include <vector>

#include "shapegcode/command.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/shaper.hpp"

using shapegcode::contour_kernel;
using shapegcode::ContourSolver;
using shapegcode::ContourTarget;
using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::Mode;

namespace {

using Column = std::vector<double>;

/// The least-squares problem row by row, as it is stated: first the errors, then the weighted second differences.
struct LeastSquares {
  Eigen::SparseMatrix<double> matrix;
  Eigen::VectorXd right;

  LeastSquares(const Column& kernel, double smoothness, const Column& error, const Column& carried,
               const Column& stiffness) {
    const std::size_t reach = kernel.size() - 1;
    const std::size_t m = error.size() - reach;
    std::vector<Eigen::Triplet<double>> entries;
    right = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(error.size() + m + 2));
    // Factor of the correction k samples behind the window's begin, unknown or given out before; zero behind the end.
    const auto add = [&](std::size_t row, std::ptrdiff_t k, double factor) {
      if (k >= static_cast<std::ptrdiff_t>(m)) return;
      if (k >= 0) {
        entries.emplace_back(static_cast<int>(row), static_cast<int>(k), factor);
      } else {
        right[static_cast<Eigen::Index>(row)] -= factor * carried[carried.size() - static_cast<std::size_t>(-k)];
      }
    };
    for (std::size_t row = 0; row < error.size(); ++row) {
      right[static_cast<Eigen::Index>(row)] = -error[row];
      for (std::size_t j = 0; j < kernel.size(); ++j)
        add(row, static_cast<std::ptrdiff_t>(row) - static_cast<std::ptrdiff_t>(j), kernel[j]);
    }
    for (std::size_t d = 0; d < m + 2; ++d) {
      const double root = std::sqrt(smoothness * (stiffness.empty() ? 1.0 : stiffness[d]));
      const auto k = static_cast<std::ptrdiff_t>(d);
      const std::size_t row = error.size() + d;
      add(row, k, root);
      add(row, k - 1, -2.0 * root);
      add(row, k - 2, root);
    }
    matrix.resize(right.size(), static_cast<Eigen::Index>(m));
    matrix.setFromTriplets(entries.begin(), entries.end());
  }

  [[nodiscard]] Eigen::VectorXd by_dense_qr() const {
    return Eigen::MatrixXd(matrix).colPivHouseholderQr().solve(right);
  }
  [[nodiscard]] Eigen::VectorXd by_sparse_cholesky() const {
    const Eigen::SparseMatrix<double> normal = matrix.transpose() * matrix;
    const Eigen::VectorXd projected = matrix.transpose() * right;
    return Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>(normal).solve(projected);
  }
};

struct Random {
  std::mt19937_64 engine{20261121};
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(engine); }
  Column column(std::size_t n, double size) {
    Column result(n);
    for (double& value : result) value = uniform(-size, size);
    return result;
  }
};

Column scaled_to_one(Column kernel) {
  double sum = 0.0;
  for (const double tap : kernel) sum += tap;
  for (double& tap : kernel) tap /= sum;
  return kernel;
}

Column solved(ContourSolver& solver, const Column& error, const Column& carried, const Column& stiffness = {}) {
  Column correction = carried;
  correction.resize(carried.size() + error.size() - solver.reach());
  solver.solve(error, correction, stiffness);
  CHECK(std::equal(carried.begin(), carried.end(), correction.begin()));
  return {correction.begin() + static_cast<std::ptrdiff_t>(carried.size()), correction.end()};
}

double largest_difference(const Column& found, const Eigen::VectorXd& expected) {
  REQUIRE(static_cast<Eigen::Index>(found.size()) == expected.size());
  return (Eigen::Map<const Eigen::VectorXd>(found.data(), expected.size()) - expected).cwiseAbs().maxCoeff();
}

Fir shaper_on_half_grid(double period_s) {
  const std::vector<Mode> modes{{46.0, 0.02, 1.0}, {131.0, 0.02, 1.0}};
  return to_fir(shapegcode::grid_polynomial(modes, period_s), period_s).on_finer_grid(2);
}

/// Kernels as they occur: shapers on half the grid with every other tap zero, and those followed by a mode.
std::vector<Column> machine_kernels() {
  const Fir shaper = shaper_on_half_grid(0.005);
  const std::vector<Mode> mode{{46.0, 0.02, 1.0}};
  return {contour_kernel(shaper, mode, 0.0025, ContourTarget::command),
          contour_kernel(shaper, mode, 0.0025, ContourTarget::response)};
}

}  // namespace

TEST_CASE("contour solver: the minimum of the stated sum, against a dense least-squares solve") {
  Random random;
  std::vector<Column> kernels = machine_kernels();
  kernels.push_back({1.0});
  kernels.push_back({0.5, 0.5});
  kernels.push_back({0.0, 0.0, 1.0});
  for (const std::size_t size : {3U, 7U, 20U, 41U}) {
    Column dense = random.column(size, 1.0);
    dense[0] += 2.0;
    kernels.push_back(scaled_to_one(dense));
    Column sparse(size, 0.0);
    sparse.front() = 0.3;
    sparse[size / 2] = 0.3;
    sparse.back() = 0.4;
    kernels.push_back(scaled_to_one(sparse));
  }
  for (const Column& kernel : kernels) {
    for (const double smoothness : {1.0, 0.01, 30.0}) {
      ContourSolver solver(kernel, smoothness);
      REQUIRE(solver.reach() == kernel.size() - 1);
      for (const std::size_t m : {1U, 2U, 3U, 8U, 40U, 97U}) {
        CAPTURE(kernel.size());
        CAPTURE(smoothness);
        CAPTURE(m);
        const Column error = random.column(m + solver.reach(), 1.0);
        const Column rest(solver.reach() + 2, 0.0);
        const Column carried = random.column(solver.reach() + 2, 0.5);
        Column stiffness(m + 2, 1.0);
        for (double& factor : stiffness) factor = std::pow(10.0, random.uniform(0.0, 3.0));
        CHECK(largest_difference(solved(solver, error, rest),
                                 LeastSquares(kernel, smoothness, error, rest, {}).by_dense_qr()) < 1e-9);
        CHECK(largest_difference(solved(solver, error, carried),
                                 LeastSquares(kernel, smoothness, error, carried, {}).by_dense_qr()) < 1e-9);
        CHECK(largest_difference(solved(solver, error, carried, stiffness),
                                 LeastSquares(kernel, smoothness, error, carried, stiffness).by_dense_qr()) < 1e-9);
      }
    }
  }
}

TEST_CASE("contour solver: long windows, where the factor's rows have settled, against a sparse solve") {
  Random random;
  for (const Column& kernel : machine_kernels()) {
    for (const double smoothness : {1.0, 0.003}) {
      ContourSolver solver(kernel, smoothness);
      for (const std::size_t m : {3000U, 500U, 1500U}) {  // shorter ones too, behind a longer one
        const Column error = random.column(m + solver.reach(), 0.05);
        const Column carried = random.column(solver.reach() + 2, 0.01);
        Column stiffness(m + 2, 1.0);
        for (std::size_t k = m / 3; k < m / 3 + 40; ++k) stiffness[k] = 8000.0;
        CHECK(largest_difference(solved(solver, error, carried),
                                 LeastSquares(kernel, smoothness, error, carried, {}).by_sparse_cholesky()) < 1e-9);
        CHECK(largest_difference(solved(solver, error, carried, stiffness),
                                 LeastSquares(kernel, smoothness, error, carried, stiffness).by_sparse_cholesky()) <
              1e-9);
      }
    }
  }
}

TEST_CASE("contour solver: windows that are carried on give the whole window's correction") {
  Random random;
  for (const Column& kernel : machine_kernels()) {
    ContourSolver solver(kernel, 1.0);
    const std::size_t past = solver.reach() + 2;
    const std::size_t m = 3000;
    // Smooth errors as a path gives them.
    Column error(m + solver.reach());
    for (std::size_t k = 0; k < error.size(); ++k) {
      error[k] = 0.03 * std::sin(0.011 * static_cast<double>(k)) + (k % 700 < 300 ? 0.02 : 0.0);
    }
    const Column whole = solved(solver, error, Column(past, 0.0));
    // From the whole window's own values on, what is left of it is its own minimum.
    for (const std::size_t cut : {past, std::size_t{777}, m - 1}) {
      const Column carried(whole.begin() + static_cast<std::ptrdiff_t>(cut - past),
                           whole.begin() + static_cast<std::ptrdiff_t>(cut));
      const Column rest = solved(solver, {error.begin() + static_cast<std::ptrdiff_t>(cut), error.end()}, carried);
      double worst = 0.0;
      for (std::size_t k = 0; k < rest.size(); ++k) worst = std::max(worst, std::abs(rest[k] - whole[cut + k]));
      CHECK(worst < 1e-12);
    }
    // Window by window with some look-ahead, of which nothing is given out.
    const std::size_t ahead = 12 * past;
    Column pieces(past, 0.0);
    for (std::size_t begin = 0; begin < m; begin += 400) {
      const std::size_t end = std::min(begin + 400 + ahead, m);
      const Column carried(pieces.end() - static_cast<std::ptrdiff_t>(past), pieces.end());
      const Column window = solved(solver,
                                   {error.begin() + static_cast<std::ptrdiff_t>(begin),
                                    error.begin() + static_cast<std::ptrdiff_t>(end + solver.reach())},
                                   carried);
      const std::size_t taken = std::min<std::size_t>(400, m - begin);
      pieces.insert(pieces.end(), window.begin(), window.begin() + static_cast<std::ptrdiff_t>(taken));
    }
    double worst = 0.0;
    for (std::size_t k = 0; k < m; ++k) worst = std::max(worst, std::abs(pieces[past + k] - whole[k]));
    CHECK(worst < 1e-6);  // a thousandth of a least increment
  }
}

TEST_CASE("contour solver: refuses what it cannot solve") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(ContourSolver({}, 1.0), Error);
  CHECK_THROWS_AS(ContourSolver({1.0, nan}, 1.0), Error);
  CHECK_THROWS_AS(ContourSolver({1.0, -1.0}, 1.0), Error);
  for (const double smoothness : {0.0, -1.0, nan, std::numeric_limits<double>::infinity()})
    CHECK_THROWS_AS(ContourSolver({1.0}, smoothness), Error);
  ContourSolver solver({0.5, 0.0, 0.5}, 1.0);
  Column correction(4 + 10);
  const auto solve = [&](std::size_t errors, std::size_t stiffnesses) {
    solver.solve(Column(errors, 0.0), correction, Column(stiffnesses, 1.0));
  };
  CHECK_NOTHROW(solve(12, 0));
  CHECK_NOTHROW(solve(12, 12));
  CHECK_THROWS_AS(solve(11, 0), Error);
  CHECK_THROWS_AS(solve(13, 0), Error);
  CHECK_THROWS_AS(solve(12, 11), Error);
  correction.resize(3);
  CHECK_THROWS_AS(solve(2, 0), Error);
  correction.resize(4);
  CHECK_NOTHROW(solve(2, 0));
}

TEST_CASE("contour kernel: what one axis does to another through a mode") {
  const Fir shaper = shaper_on_half_grid(0.005);
  const double h = 0.0025;
  const std::vector<Mode> modes{{46.0, 0.0, 0.4, {0.0, 0.5, 0.0}}, {70.0, 0.01, 1.0}};
  CHECK(contour_kernel(shaper, modes, h, ContourTarget::command, {2, 1}).empty());
  CHECK(contour_kernel(shaper, modes, h, ContourTarget::response, {2, 0}).empty());
  // Its own axis does not know of the mode that Y excites.
  const std::vector<Mode> own{modes[1]};
  CHECK(contour_kernel(shaper, modes, h, ContourTarget::response, {2, 2}) ==
        contour_kernel(shaper, own, h, ContourTarget::response));
  const Column kernel = contour_kernel(shaper, modes, h, ContourTarget::response, {2, 1});
  double sum = 0.0;
  double moment = 0.0;
  for (std::size_t k = 0; k < kernel.size(); ++k) {
    sum += kernel[k];
    moment += kernel[k] * static_cast<double>(k);
  }
  CHECK(std::abs(sum) < 1e-12);  // a steady motion of Y leaves Z where it is
  CHECK(std::abs(moment) < 1e-9);
  // As in the case below, times participation and excitation, and without the command itself.
  const double w = 2.0 * 3.14159265358979323846 * 46.0;
  const Column plain = contour_kernel(shaper, modes, h, ContourTarget::command);
  const auto ring = [&](double time) { return time > 0.0 ? std::sin(w * time) / w : 0.0; };
  for (std::size_t k = 0; k < plain.size(); ++k) {
    double expected = 0.0;
    for (std::size_t j = 0; j <= k; ++j) {
      const double time = static_cast<double>(k - j) * h;
      expected -= 0.4 * 0.5 * plain[j] / h * (ring(time + h) - 2.0 * ring(time) + ring(time - h));
    }
    CAPTURE(k);
    CHECK(kernel[k] == doctest::Approx(expected).epsilon(0.002));
  }
}

TEST_CASE("contour kernel: the shaper's taps, or the response to a unit step of the command seen as increments") {
  const Fir shaper = shaper_on_half_grid(0.005);
  const std::vector<Mode> mode{{46.0, 0.02, 1.0}};
  const Column plain = contour_kernel(shaper, mode, 0.0025, ContourTarget::command);
  REQUIRE(plain.size() == static_cast<std::size_t>(shaper.duration_samples()) + 1);
  for (std::size_t k = 0; k < plain.size(); ++k) {
    const auto found = std::find(shaper.delays().begin(), shaper.delays().end(), static_cast<int>(k));
    const double expected =
        found == shaper.delays().end() ? 0.0 : shaper.taps()[static_cast<std::size_t>(found - shaper.delays().begin())];
    CHECK(plain[k] == expected);
  }
  CHECK(contour_kernel(shaper, {}, 0.0025, ContourTarget::response) == plain);
  // Behind a shaper that cancels the mode nothing rings, and the kernel hardly grows.
  const Column response = contour_kernel(shaper, mode, 0.0025, ContourTarget::response);
  CHECK(response.size() <= plain.size() + 2);
  double sum = 0.0;
  for (const double tap : response) sum += tap;
  CHECK(sum == doctest::Approx(1.0).epsilon(1e-12));
  // An undamped mode in closed form: e'' + w^2 e = -x'' for a command whose slope changes by d at time t gives
  // e = -d/w sin w(T - t). A tap is a triangle of one period to both sides.
  const double w = 2.0 * 3.14159265358979323846 * 46.0;
  const double h = 0.0025;
  const std::vector<Mode> undamped{{46.0, 0.0, 1.0}};
  const Column exact = contour_kernel(shaper, undamped, h, ContourTarget::response);
  const auto ring = [&](double time) { return time > 0.0 ? std::sin(w * time) / w : 0.0; };
  for (std::size_t k = 0; k < std::min<std::size_t>(exact.size(), plain.size()); ++k) {
    double expected = plain[k];
    for (std::size_t j = 0; j <= k; ++j) {
      const double time = static_cast<double>(k - j) * h;
      expected -= plain[j] / h * (ring(time + h) - 2.0 * ring(time) + ring(time - h));
    }
    CAPTURE(k);
    CHECK(exact[k] == doctest::Approx(expected).epsilon(0.002));
  }
}
