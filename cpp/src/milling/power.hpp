// A power of positive numbers with a fixed exponent, several times as fast as std::pow.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace shapegcode {

/// t^exponent for normal t > 0 to 1e-10; 0 for t <= 0. The mantissa's power is interpolated by cubics, that of the
/// binary exponent is tabulated.
class Power {
 public:
  explicit Power(double exponent) : exponent_(exponent) {
    for (std::size_t i = 0; i <= cells; ++i) {
      const double mantissa = 1.0 + static_cast<double>(i) / cells;
      value_[i] = std::pow(mantissa, exponent);
      slope_[i] = exponent * std::pow(mantissa, exponent - 1.0) / cells;
    }
    for (int e = 0; e < scales; ++e) scale_[static_cast<std::size_t>(e)] = std::exp2(exponent * (e + least));
  }

  [[nodiscard]] double exponent() const noexcept { return exponent_; }

  [[nodiscard]] double operator()(double t) const noexcept {
    if (!(t > 0.0)) return 0.0;
    if (exponent_ == 1.0) return t;
    const auto bits = std::bit_cast<std::uint64_t>(t);
    const int scale = static_cast<int>(bits >> 52U) - 1023 - least;
    if (scale < 0 || scale >= scales) return std::pow(t, exponent_);
    const double mantissa = std::bit_cast<double>((bits & 0x000fffffffffffffU) | 0x3ff0000000000000U);
    const double at = (mantissa - 1.0) * cells;
    const auto cell = static_cast<std::size_t>(at);
    const double x = at - static_cast<double>(cell);
    const double rise = value_[cell + 1] - value_[cell];
    const double a = slope_[cell] - rise;
    const double b = rise - slope_[cell + 1];
    const double mean = value_[cell] + x * rise + x * (1.0 - x) * (a * (1.0 - x) + b * x);
    return mean * scale_[static_cast<std::size_t>(scale)];
  }

 private:
  static constexpr std::size_t cells = 128;
  static constexpr int least = -60;
  static constexpr int scales = 64;

  double exponent_;
  std::array<double, cells + 1> value_{};
  std::array<double, cells + 1> slope_{};
  std::array<double, scales> scale_{};
};

}  // namespace shapegcode
