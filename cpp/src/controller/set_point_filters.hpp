// What follows the path in a control: contour correction, smoothing and shaper of every axis, and of its velocity and
// acceleration. A shaper that follows a position is the first of them.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "controller/changing_shaper.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

class SetPointFilters {
 public:
  /// Throws Error(argument) on times that are none, or as many shapers as there are not axes.
  SetPointFilters(const ControllerSettings& settings, int n_axes);

  /// At rest at a position, n_axes values.
  void reset(std::span<const double> position) noexcept;
  /// In place: positions of all axes, their velocities, their accelerations. What a change of taps adds to the latter
  /// two is not in them.
  void step(std::span<double> values) noexcept;
  [[nodiscard]] static constexpr std::size_t values(std::size_t n_axes) noexcept { return orders * n_axes; }

  /// Of the whole chain: samples that it lasts, its largest mean delay, the correction's share of that.
  [[nodiscard]] int duration_samples() const noexcept { return duration_; }
  [[nodiscard]] double mean_samples() const noexcept { return mean_; }
  [[nodiscard]] int correction_samples() const noexcept { return correction_delay_; }
  /// Largest sum of the magnitudes of an axis' taps: by how much it may exceed what comes in.
  [[nodiscard]] double gain() const noexcept { return gain_; }
  /// What a shaper costs while it follows a position.
  [[nodiscard]] const ChangeCost& change() const noexcept { return change_; }
  /// The moments that say what it cuts off.
  [[nodiscard]] const FilterTolerance& tolerance() const noexcept { return tolerance_; }

 private:
  static constexpr std::size_t orders = 3;  // position, velocity, acceleration

  // One filter for all axes, or one for each.
  class AxisFilters {
   public:
    AxisFilters(const std::vector<Fir>& filters, int n_axes);
    void reset(std::span<const double> values) noexcept;
    void step(std::span<double> values) noexcept;

   private:
    std::vector<FirStream> streams_;
  };

  void measure(const Fir& chain, double period_s);

  std::vector<AxisFilters> chain_;
  std::optional<FollowingFir> following_;
  std::vector<VaryingFirStream> varying_;  // one where the shaper follows an axis
  double followed_mm_ = 0.0;
  std::vector<double> rest_;  // what the filters rest at
  int duration_ = 0;
  double mean_ = 0.0;
  int correction_delay_ = 0;
  double gain_ = 1.0;
  ChangeCost change_;
  FilterTolerance tolerance_;
};

}  // namespace shapegcode
