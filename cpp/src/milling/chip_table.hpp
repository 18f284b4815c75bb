// Contribution of a tooth element at its azimuth, integrated over azimuth: a flute's force is a difference of two
// entries, for any helix.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "milling/power.hpp"

namespace shapegcode {

/// Thickness of the chip of one flute against u = feed per tooth * cos(azimuth), both in mm: the least of
/// m u + r_i - r_(i-m) over the m-th flute ahead, m >= 1, and not below 0.
class ChipProfile {
 public:
  /// Without runout: u itself.
  ChipProfile() : lines_{{0.0, 1.0, 0.0}} {}
  /// `runout_mm`: of all flutes in the order in which they cut.
  ChipProfile(const std::vector<double>& runout_mm, int flute);

  [[nodiscard]] double operator()(double u) const noexcept {
    std::size_t k = lines_.size() - 1;
    while (k > 0 && u < lines_[k].from_u) --k;
    const double t = lines_[k].slope * u + lines_[k].offset;
    return t > 0.0 ? t : 0.0;
  }
  /// Where the profile has a kink, u > 0.
  [[nodiscard]] const std::vector<double>& kinks() const noexcept { return kinks_; }

 private:
  struct Line {
    double from_u;
    double slope;
    double offset;
  };
  std::vector<Line> lines_;
  std::vector<double> kinks_;
};

/// The powers of the chip that the tables hold.
struct ChipPowers {
  Power tangential;
  Power radial;
  bool edges;  ///< whether the plain length in contact is needed, too

  [[nodiscard]] bool one_power() const noexcept { return tangential.exponent() == radial.exponent(); }
};

/// Integrals over azimuth from 0 of (t^q1 sin, t^q1 cos, t^q1), of (t^q2 sin, t^q2 cos) if q2 differs, and of
/// (sin, cos, 1) while t > 0 if edge forces are asked for; t is the chip at the azimuth. Cubic Hermite on a grid that
/// is dense towards +-pi/2, where t begins as a power of the distance.
class ChipTable {
 public:
  static constexpr std::size_t most = 8;
  using Values = std::array<double, most>;

  /// `feed_per_tooth_mm`: 1 for a unit chip. A quick table (1e-5) is made in an eighth of the time of the other (1e-9).
  ChipTable(const ChipPowers& powers, ChipProfile profile, double feed_per_tooth_mm, bool quick);

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// The integrals from 0 to an azimuth within -pi/2 ... pi/2.
  void cumulated(double azimuth, Values& out) const noexcept;
  /// Makes what cumulated_twice needs, unless it is there.
  void prepare_twice();
  /// The integrals of those integrals; prepare_twice() must have been called.
  void cumulated_twice(double azimuth, Values& out) const noexcept;
  /// The integrands.
  void density(double azimuth, Values& out) const noexcept;
  /// Thickness of the chip at an azimuth, mm.
  [[nodiscard]] double chip_mm(double azimuth) const noexcept;

 private:
  struct Grid;
  void look_up(const std::vector<double>& nodes, double azimuth, bool odd_sines, Values& out) const noexcept;
  void values(double sine, double cosine, Values& out) const noexcept;
  void integrate_section(double from, double to, Values& sum) const;
  void integrate(std::size_t cell, const Values& lower, const Values& upper, Values& sum) const;

  ChipPowers powers_;
  ChipProfile profile_;
  double feed_mm_;
  std::size_t size_;
  const Grid& grid_;
  std::vector<double> kinks_;  // grid coordinate 0 ... 1 of the profile's kinks
  std::vector<double> nodes_;  // value and slope by grid coordinate of each integral, node by node
  std::vector<double> twice_;  // the same of their integrals; empty until asked for
};

}  // namespace shapegcode
