#include "shapegcode/command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

// Relative change of a factor's row below which the row is used for all later ones.
constexpr double settling_change = 1e-13;
constexpr std::array<double, 3> second_difference{1.0, -2.0, 1.0};

// l(i, i-j) of a row of `band`+1 values.
double dot(const double* a, const double* b, std::size_t n) noexcept {
  double sum = 0.0;
  for (std::size_t k = 0; k < n; ++k) {
    sum += a[k] * b[k];
  }
  return sum;
}

// The next row of a banded Cholesky factor from its `band` predecessors. `row` enters with the matrix' own row i (the
// diagonal last) and leaves with the factor's, its diagonal inverted. `rows_before`: how many predecessors there are.
void factor_row(double* row, std::size_t band, std::size_t rows_before) noexcept {
  const std::size_t width = band + 1;
  const std::size_t first = rows_before >= band ? 0 : band - rows_before;  // entries before have no column
  std::fill(row, row + first, 0.0);
  for (std::size_t j = first; j < band; ++j) {
    // Column i-band+j: row i-band+j of the factor lies (band-j) rows up; its entries end at its own diagonal.
    const double* other = row - (band - j) * width;
    // Shared columns: those of this row before j, which stand band-j further on in the other row.
    row[j] = (row[j] - dot(row, other + (band - j), j)) * other[band];
  }
  row[band] = 1.0 / std::sqrt(row[band] - dot(row, row, band));
}

// Solves in place behind a factor of rows of `band`+1 values, the diagonal inverted; its last row stands for all that
// follow.
void substitute(std::span<const double> factor, std::size_t band, std::span<double> x) noexcept {
  const std::size_t width = band + 1;
  const std::size_t last = factor.size() / width - 1;
  const auto row_of = [&](std::size_t i) { return factor.data() + std::min(i, last) * width; };
  for (std::size_t i = 0; i < x.size(); ++i) {
    const double* row = row_of(i);
    const std::size_t reach = std::min(i, band);
    x[i] = (x[i] - dot(row + (band - reach), x.data() + (i - reach), reach)) * row[band];
  }
  for (std::size_t i = x.size(); i-- > 0;) {
    const double* row = row_of(i);
    x[i] *= row[band];
    const std::size_t reach = std::min(i, band);
    double* before = x.data() + (i - reach);
    const double value = x[i];
    for (std::size_t j = 0; j < reach; ++j) {
      before[j] -= row[band - reach + j] * value;
    }
  }
}

}  // namespace

ContourSolver::ContourSolver(std::vector<double> kernel, double smoothness)
    : kernel_(std::move(kernel)), smoothness_(smoothness), band_(0) {
  const bool finite = std::ranges::all_of(kernel_, [](double tap) { return std::isfinite(tap); });
  if (kernel_.empty() || !finite || std::accumulate(kernel_.begin(), kernel_.end(), 0.0) == 0.0) {
    throw Error(ErrorKind::argument, "the kernel of a contour correction needs finite taps with a sum other than 0");
  }
  if (!(smoothness > 0.0) || !std::isfinite(smoothness)) {
    throw Error(ErrorKind::argument,
                fmt::format("smoothness of a contour correction is {:g}, must be finite and above 0", smoothness));
  }
  band_ = std::max<std::size_t>(kernel_.size() - 1, 2);
  column_.assign(band_ + 1, 0.0);
  for (std::size_t j = 0; j < kernel_.size(); ++j) {
    column_[j] = dot(kernel_.data(), kernel_.data() + j, kernel_.size() - j);
    if (kernel_[j] != 0.0) {
      taps_.push_back(j);
    }
  }
  column_[0] += 6.0 * smoothness_;
  column_[1] -= 4.0 * smoothness_;
  column_[2] += smoothness_;
}

void ContourSolver::extend_factor(std::size_t rows) {
  const std::size_t width = band_ + 1;
  while (!is_settled_ && factor_rows_ < rows) {
    factor_.resize((factor_rows_ + 1) * width);
    double* row = factor_.data() + factor_rows_ * width;
    std::reverse_copy(column_.begin(), column_.end(), row);
    factor_row(row, band_, factor_rows_);
    if (factor_rows_ > band_) {
      const double* before = row - width;
      double change = 0.0;
      for (std::size_t j = 0; j < width; ++j) {
        change = std::max(change, std::abs(row[j] - before[j]));
      }
      is_settled_ = change <= settling_change * row[band_];
    }
    ++factor_rows_;
  }
}

void ContourSolver::factor_and_solve(std::span<const double> stiffness, std::span<double> x) {
  const std::size_t width = band_ + 1;
  const std::size_t n = x.size();
  own_factor_.resize(n * width);
  for (std::size_t i = 0; i < n; ++i) {
    double* row = own_factor_.data() + i * width;
    std::reverse_copy(column_.begin(), column_.end(), row);
    // The stiffness of the three second differences that hold unknown i takes the place of the plain one.
    for (std::size_t j = 0; j <= 2; ++j) {
      double sum = 0.0;
      for (std::size_t d = 0; d + j <= 2; ++d) {
        sum += (stiffness[i + d] - 1.0) * second_difference[d] * second_difference[d + j];
      }
      row[band_ - j] += smoothness_ * sum;
    }
    factor_row(row, band_, i);
  }
  substitute(own_factor_, band_, x);
}

void ContourSolver::solve(std::span<const double> error, std::span<double> correction,
                          std::span<const double> stiffness) {
  const std::size_t past = reach() + 2;
  const std::size_t m = correction.size() - std::min(past, correction.size());
  if (correction.size() < past || error.size() != m + reach() || (!stiffness.empty() && stiffness.size() != m + 2)) {
    throw Error(ErrorKind::argument,
                fmt::format("a contour correction of {} samples needs {} errors and {} or no stiffnesses: {} and {} "
                            "given",
                            m, m + reach(), m + 2, error.size(), stiffness.size()));
  }
  if (m == 0) {
    return;
  }
  // What the carried corrections leave to be corrected.
  work_.assign(error.begin(), error.end());
  const double* carried = correction.data() + past;  // carried[-k] is k samples before the window
  for (std::size_t k = 0; k < reach(); ++k) {
    for (const std::size_t j : taps_) {
      if (j > k) {
        work_[k] += kernel_[j] * *(carried - (j - k));
      }
    }
  }
  std::span<double> x = correction.subspan(past);
  for (std::size_t k = 0; k < m; ++k) {
    double sum = 0.0;
    for (const std::size_t j : taps_) {
      sum += kernel_[j] * work_[k + j];
    }
    x[k] = -sum;
  }
  const auto weight = [&](std::size_t k) { return smoothness_ * (stiffness.empty() ? 1.0 : stiffness[k]); };
  const double last = correction[past - 1];
  const double before_last = correction[past - 2];
  const double first_row = weight(0) * (before_last - 2.0 * last);
  const double second_row = weight(1) * last;
  x[0] -= first_row - 2.0 * second_row;
  if (m > 1) {
    x[1] -= second_row;
  }
  if (stiffness.empty()) {
    extend_factor(m);
    substitute(factor_, band_, x);
  } else {
    factor_and_solve(stiffness, x);
  }
}

}  // namespace shapegcode
