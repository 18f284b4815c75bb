#include "shaper/minimal/small_square.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace shapegcode::minimal {

namespace {

bool usable_pivot(double size) noexcept { return size > 0.0 && size <= std::numeric_limits<double>::max(); }

}  // namespace

// Gauss-Jordan by columns, which lie contiguous: the pivot is the largest value of its row in the columns still to go.
bool invert(Square& matrix) noexcept {
  const auto n = static_cast<std::size_t>(matrix.rows());
  double* const values = matrix.data();
  std::array<std::size_t, max_unknowns> taken{};
  for (std::size_t k = 0; k < n; ++k) {
    std::size_t pivot = k;
    double largest = std::abs(values[k * n + k]);
    for (std::size_t j = k + 1; j < n; ++j) {
      const double size = std::abs(values[j * n + k]);
      if (size > largest) {
        largest = size;
        pivot = j;
      }
    }
    if (!usable_pivot(largest)) {
      return false;
    }
    taken[k] = pivot;
    double* const column = values + k * n;
    if (pivot != k) {
      for (std::size_t i = 0; i < n; ++i) {
        std::swap(column[i], values[pivot * n + i]);
      }
    }
    const double scale = 1.0 / column[k];
    column[k] = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
      column[i] *= scale;
    }
    for (std::size_t j = 0; j < n; ++j) {
      if (j != k) {
        double* const other = values + j * n;
        const double share = other[k];
        other[k] = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
          other[i] -= share * column[i];
        }
      }
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    if (taken[k] != k) {
      for (std::size_t j = 0; j < n; ++j) {
        std::swap(values[j * n + k], values[j * n + taken[k]]);
      }
    }
  }
  return true;
}

// Gauss with the largest pivot of the column.
bool solve(Square& matrix, Vector& right) noexcept {
  const auto n = static_cast<std::size_t>(matrix.rows());
  double* const values = matrix.data();
  double* const x = right.data();
  for (std::size_t k = 0; k < n; ++k) {
    double* const column = values + k * n;
    std::size_t pivot = k;
    for (std::size_t i = k + 1; i < n; ++i) {
      if (std::abs(column[i]) > std::abs(column[pivot])) {
        pivot = i;
      }
    }
    if (!usable_pivot(std::abs(column[pivot]))) {
      return false;
    }
    if (pivot != k) {
      std::swap(x[k], x[pivot]);
      for (std::size_t j = k; j < n; ++j) {
        std::swap(values[j * n + k], values[j * n + pivot]);
      }
    }
    for (std::size_t i = k + 1; i < n; ++i) {
      column[i] /= column[k];
      x[i] -= column[i] * x[k];
    }
    for (std::size_t j = k + 1; j < n; ++j) {
      double* const other = values + j * n;
      const double share = other[k];
      for (std::size_t i = k + 1; i < n; ++i) {
        other[i] -= share * column[i];
      }
    }
  }
  for (std::size_t k = n; k-- > 0;) {
    x[k] /= values[k * n + k];
    for (std::size_t i = 0; i < k; ++i) {
      x[i] -= values[k * n + i] * x[k];
    }
  }
  return true;
}

}  // namespace shapegcode::minimal
