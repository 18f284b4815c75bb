#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/measure/follow.hpp"

using shapegcode::make_arc;
using shapegcode::make_line;
using shapegcode::Path;
using shapegcode::PathFollower;
using shapegcode::thin_curves;
using shapegcode::Vector3;

namespace {

Eigen::VectorXd evenly(Eigen::Index rows) {
  return Eigen::VectorXd::LinSpaced(rows, 0.0, static_cast<double>(rows) - 1.0);
}

/// Largest distance of any curve from the straight lines between the kept rows, in its tolerances.
double largest_miss(const Eigen::MatrixXd& values, const Eigen::VectorXd& tolerances,
                    const std::vector<std::size_t>& kept) {
  double largest = 0.0;
  for (std::size_t i = 1; i < kept.size(); ++i) {
    const auto first = static_cast<Eigen::Index>(kept[i - 1]);
    const auto last = static_cast<Eigen::Index>(kept[i]);
    for (Eigen::Index row = first; row <= last; ++row) {
      const double share = static_cast<double>(row - first) / static_cast<double>(last - first);
      const Eigen::RowVectorXd line = (1.0 - share) * values.row(first) + share * values.row(last);
      largest =
          std::max(largest, ((values.row(row) - line).transpose().cwiseAbs().cwiseQuotient(tolerances)).maxCoeff());
    }
  }
  return largest;
}

}  // namespace

TEST_CASE("a table beside a line and an arc is as far from them as it was put") {
  const double radius = 10.0;
  const Path path({make_line({0, 0, 0}, {20, 0, 0}, 100.0),
                   make_arc({20, 0, 0}, {30, 10, 0}, {20, 10, 0}, std::numbers::pi / 2, 2, 100.0)});
  std::vector<Vector3> command;
  std::vector<Vector3> response;
  std::vector<Vector3> expected;
  for (int i = 0; i <= 100; ++i) {
    command.emplace_back(0.2 * i, 0.0, 0.0);
    expected.emplace_back(0.0, 0.004, -0.002);
  }
  for (int i = 1; i < 100; ++i) {
    const double angle = 0.5 * std::numbers::pi * i / 100.0;
    const Vector3 outward(std::sin(angle), -std::cos(angle), 0.0);
    command.emplace_back(Vector3(20, 10, 0) + radius * outward);
    expected.emplace_back(0.003 * outward);
  }
  const auto rows = static_cast<Eigen::Index>(command.size());
  Eigen::MatrixXd commands(rows, 3);
  Eigen::MatrixXd responses(rows, 3);
  for (Eigen::Index i = 0; i < rows; ++i) {
    commands.row(i) = command[static_cast<std::size_t>(i)];
    responses.row(i) = command[static_cast<std::size_t>(i)] + expected[static_cast<std::size_t>(i)];
  }
  PathFollower follower(path);
  const Eigen::Index half = rows / 3;  // the state is carried from piece to piece
  const Eigen::MatrixXd first = follower.step(commands.topRows(half), responses.topRows(half));
  const Eigen::MatrixXd second = follower.step(commands.bottomRows(rows - half), responses.bottomRows(rows - half));
  for (Eigen::Index i = 0; i < rows; ++i) {
    const Eigen::RowVector3d found = i < half ? first.row(i) : second.row(i - half);
    CHECK((found.transpose() - expected[static_cast<std::size_t>(i)]).norm() < 1e-9);
  }
  CHECK_THROWS_AS(static_cast<void>(follower.step(commands, responses.topRows(3))), shapegcode::Error);
}

TEST_CASE("thinned curves stay within their tolerances, and straight ones lose all but their ends") {
  std::mt19937 random(7);
  std::normal_distribution<double> step(0.0, 1.0);
  Eigen::MatrixXd values(5000, 3);
  for (Eigen::Index row = 0; row < values.rows(); ++row) {
    const double t = 0.01 * static_cast<double>(row);
    values(row, 0) = std::sin(t);
    values(row, 1) = (row > 0 ? values(row - 1, 1) : 0.0) + step(random);
    values(row, 2) = std::floor(t);
  }
  const Eigen::Vector3d tolerances(0.01, 5.0, 0.5);
  const std::vector<std::size_t> kept = thin_curves(evenly(5000), values, tolerances);
  CHECK(kept.front() == 0);
  CHECK(kept.back() == 4999);
  CHECK(std::is_sorted(kept.begin(), kept.end()));
  CHECK(kept.size() < 2500);
  CHECK(largest_miss(values, tolerances, kept) <= 1.0 + 1e-9);
  // A sine of amplitude A is within e of chords of about sqrt(8 e / A): 0.28 here, so 50 / 0.28 and not many more.
  const std::vector<std::size_t> sine = thin_curves(evenly(5000), values.col(0), Eigen::VectorXd::Constant(1, 0.01));
  CHECK(sine.size() > 100);
  CHECK(sine.size() < 400);
  Eigen::MatrixXd straight(1000, 1);
  straight.col(0) = Eigen::VectorXd::LinSpaced(1000, -3.0, 5.0);
  CHECK(thin_curves(evenly(1000), straight, Eigen::VectorXd::Constant(1, 1e-6)) ==
        std::vector<std::size_t>{0, 512, 999});
}

TEST_CASE("a row between two that are unevenly apart is held against the line in time") {
  const Eigen::Vector3d times(0.0, 1.0, 10.0);
  const Eigen::MatrixXd on_line = Eigen::Vector3d(0.0, 2.0, 20.0);
  const Eigen::MatrixXd off_line = Eigen::Vector3d(0.0, 10.0, 20.0);
  const Eigen::VectorXd tolerance = Eigen::VectorXd::Constant(1, 0.1);
  CHECK(thin_curves(times, on_line, tolerance) == std::vector<std::size_t>{0, 2});
  CHECK(thin_curves(times, off_line, tolerance) == std::vector<std::size_t>{0, 1, 2});
}

TEST_CASE("thinning of nothing, of one row, and of what is not a curve") {
  const Eigen::VectorXd one = Eigen::VectorXd::Constant(1, 1.0);
  CHECK(thin_curves(evenly(0), Eigen::MatrixXd(0, 1), one).empty());
  CHECK(thin_curves(evenly(1), Eigen::MatrixXd::Zero(1, 1), one) == std::vector<std::size_t>{0});
  CHECK_THROWS_AS(static_cast<void>(thin_curves(evenly(3), Eigen::MatrixXd::Zero(3, 2), one)), shapegcode::Error);
  CHECK_THROWS_AS(static_cast<void>(thin_curves(evenly(3), Eigen::MatrixXd::Zero(3, 1), 0.0 * one)), shapegcode::Error);
  Eigen::MatrixXd bad = Eigen::MatrixXd::Zero(3, 1);
  CHECK_THROWS_AS(static_cast<void>(thin_curves(Eigen::Vector3d(0, 1, 1), bad, one)), shapegcode::Error);
  bad(1, 0) = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(static_cast<void>(thin_curves(evenly(3), bad, one)), shapegcode::Error);
}
