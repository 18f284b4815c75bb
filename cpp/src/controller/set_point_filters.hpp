// Filters after the path in a control: contour correction, smoothing and shaper of every axis, and of its velocity and
// acceleration. A shaper that depends on a position comes first.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "controller/changing_shaper.hpp"
#include "controller/contour_check.hpp"
#include "shapegcode/controller.hpp"

namespace shapegcode {

/// What a fade between shapers costs: outputs that are w = 0 ... 1 from one to the other, with derivatives of w that
/// are `first` to `third` at the most. As far as the outputs of an axis lie apart, up to `apart_s` times its speed,
/// these move it as well.
struct FadeCost {
  double apart_s = 0.0;
  double first = 0.0, second = 0.0, third = 0.0;
};

class SetPointFilters {
 public:
  /// Throws Error(argument) on times that are none, or as many shapers as there are not axes.
  SetPointFilters(const ControllerSettings& settings, int n_axes);

  /// At rest at a position, n_axes values.
  void reset(std::span<const double> position) noexcept;
  /// In place: positions of all axes, their velocities, their accelerations. What a change of taps adds to the latter
  /// two is not in them.
  void step(std::span<double> values) noexcept;
  /// Before a step: which shaper is wanted, from now on or when the fade that is on its way ends. Whether one is.
  bool choose(std::size_t shaper) noexcept;
  [[nodiscard]] std::size_t shapers() const noexcept { return means_.size(); }
  /// Mean delay of the chain, in samples, with a shaper; and now.
  [[nodiscard]] double mean_samples(std::size_t shaper) const noexcept { return means_[shaper]; }
  [[nodiscard]] double mean_samples() const noexcept {
    return means_[from_] + fade_.value * (means_[to_] - means_[from_]);
  }
  [[nodiscard]] std::size_t shaper() const noexcept { return to_; }
  [[nodiscard]] const FadeCost& fade() const noexcept { return cost_of_fade_; }
  [[nodiscard]] static constexpr std::size_t values(std::size_t n_axes) noexcept { return orders * n_axes; }

  /// Of the whole chain: samples that it lasts, the correction's share of its mean delay.
  [[nodiscard]] int duration_samples() const noexcept { return duration_; }
  [[nodiscard]] int correction_samples() const noexcept { return correction_delay_; }
  /// Largest sum of the magnitudes of an axis' taps: by how much it may exceed what comes in.
  [[nodiscard]] double gain() const noexcept { return gain_; }
  /// What a shaper costs while it follows a position.
  [[nodiscard]] const ChangeCost& change() const noexcept { return change_; }
  /// The moments that say what it cuts off.
  [[nodiscard]] const FilterTolerance& tolerance() const noexcept { return tolerance_; }
  /// The whole chain with each shaper that does not follow an axis.
  [[nodiscard]] const std::vector<FilterStages>& chains() const noexcept { return chains_; }

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
  void add_others(const ControllerSettings& settings, const Fir& average, std::vector<Fir> first, int n_axes);
  void measure_fade(const std::vector<Fir>& one, const std::vector<Fir>& other, double period_s);
  void step_shapers(std::span<double> values) noexcept;

  std::vector<AxisFilters> chain_;
  std::vector<AxisFilters> shapers_;  // where there are some to choose from
  std::vector<std::vector<double>> outputs_;
  std::size_t from_ = 0, to_ = 0;
  struct Fade {
    double value = 0.0, first = 0.0, second = 0.0;
  };
  Fade fade_;
  double fade_s_ = 0.0, faded_s_ = 0.0, period_s_;
  FadeCost cost_of_fade_;
  std::vector<double> means_;  // of the chain with each shaper
  std::optional<FollowingFir> following_;
  std::vector<VaryingFirStream> varying_;  // one where the shaper follows an axis
  double followed_mm_ = 0.0;
  std::vector<double> rest_;  // what the filters rest at
  int duration_ = 0;
  int correction_delay_ = 0;
  double gain_ = 1.0;
  ChangeCost change_;
  FilterTolerance tolerance_;
  std::vector<FilterStages> chains_;
};

}  // namespace shapegcode
