#include "shapegcode/measure/follow.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "base/refuse.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

// A curve full of peaks would be divided near its ends repeatedly, in quadratic time: so it is divided in windows,
// whose ends remain.
constexpr Eigen::Index window_rows = 512;

struct Furthest {
  Eigen::Index row;
  double times;  // of its tolerance
};

// Rows beside each other: columns that lie a power of two apart would share a few lines of the cache.
using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// Between two rows that remain, the one whose curves are furthest from the straight lines.
Furthest furthest_between(std::span<const double> times, const Rows& scaled, Eigen::Index first, Eigen::Index last) {
  Furthest found{first, 0.0};
  const auto curves = static_cast<std::size_t>(scaled.cols());
  const auto at = [&](Eigen::Index row) { return std::span(scaled.data() + row * scaled.cols(), curves); };
  const std::span<const double> begin = at(first);
  const std::span<const double> end = at(last);
  const double begin_time = times[static_cast<std::size_t>(first)];
  const double rate = 1.0 / (times[static_cast<std::size_t>(last)] - begin_time);
  for (Eigen::Index row = first + 1; row < last; ++row) {
    const double share = (times[static_cast<std::size_t>(row)] - begin_time) * rate;
    const std::span<const double> values = at(row);
    double off = 0.0;
    for (std::size_t curve = 0; curve < curves; ++curve) {
      off = std::max(off, std::abs(values[curve] - begin[curve] - share * (end[curve] - begin[curve])));
    }
    if (off > found.times) found = {row, off};
  }
  return found;
}

}  // namespace

PathFollower::PathFollower(const Path& path) : path_(path), command_(path), response_(path) {}

Eigen::MatrixXd PathFollower::step(const Eigen::Ref<const Eigen::MatrixXd>& command_mm,
                                   const Eigen::Ref<const Eigen::MatrixXd>& response_mm) {
  if (command_mm.rows() != response_mm.rows() || command_mm.cols() != axis_count || response_mm.cols() != axis_count) {
    refuse("command and response must have the same shape (k, 3)");
  }
  Eigen::MatrixXd left(response_mm.rows(), axis_count);
  for (Eigen::Index row = 0; row < response_mm.rows(); ++row) {
    const Vector3 command = command_mm.row(row);
    const Vector3 response = response_mm.row(row);
    command_.step(command);
    response_.step(response, command_);
    left.row(row) = response - path_.point(response_.s_mm(), cursor_);
  }
  return left;
}

std::vector<std::size_t> thin_curves(const Eigen::Ref<const Eigen::VectorXd>& times,
                                     const Eigen::Ref<const Eigen::MatrixXd>& values,
                                     const Eigen::Ref<const Eigen::VectorXd>& tolerances) {
  if (values.cols() != tolerances.size() || values.cols() == 0) refuse("one tolerance for each curve is needed");
  if (!(tolerances.array() > 0.0).all() || !tolerances.allFinite()) refuse("tolerances must be finite and above 0");
  if (!values.allFinite()) refuse("values must be finite");
  const Eigen::Index rows = values.rows();
  if (times.size() != rows || !times.allFinite()) refuse("one finite time for each row is needed");
  if (rows > 1 && !(times.tail(rows - 1).array() > times.head(rows - 1).array()).all()) refuse("times must rise");
  std::vector<std::size_t> kept;
  if (rows == 0) return kept;
  kept.push_back(0);
  if (rows == 1) return kept;
  const std::span<const double> passed(times.data(), static_cast<std::size_t>(rows));
  const Rows scaled = values * tolerances.cwiseInverse().asDiagonal();
  std::vector<std::pair<Eigen::Index, Eigen::Index>> open;
  for (Eigen::Index begin = 0; begin < rows - 1; begin += window_rows) {
    open.emplace_back(begin, std::min(begin + window_rows, rows - 1));
    // Depth first, left half before right half: rows come out in order.
    while (!open.empty()) {
      const auto [first, last] = open.back();
      open.pop_back();
      const Furthest furthest = furthest_between(passed, scaled, first, last);
      if (furthest.times > 1.0) {
        open.emplace_back(furthest.row, last);
        open.emplace_back(first, furthest.row);
      } else {
        kept.push_back(static_cast<std::size_t>(last));
      }
    }
  }
  return kept;
}

}  // namespace shapegcode
