#include "command/run_filter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

constexpr double same_delay_s = 1e-9;

}  // namespace

RunFilter::RunFilter(std::span<const Fir> shapers, ContourTarget contour_target, const AxisModes& axis_modes,
                     double block_period_s, double weight, const Followed& along)
    : target(contour_target),
      modes(axis_modes),
      half_period_s(0.5 * block_period_s),
      mean_delay_s((along.shapers ? along.shapers->fir().mean_samples() : shapers.front().mean_samples()) *
                   block_period_s),
      smoothness(weight) {
  if (shapers.size() != 1 && shapers.size() != axis_count) {
    throw Error(ErrorKind::argument, fmt::format("{} shapers: one for all axes, or one for each", shapers.size()));
  }
  for (std::size_t axis = 0; axis < axis_count; ++axis) {
    const Fir& shaper = shapers[shapers.size() == 1 ? 0 : axis];
    const double other_s = shaper.mean_samples() * block_period_s;
    if (!(std::abs(other_s - shapers.front().mean_samples() * block_period_s) <= same_delay_s)) {
      throw Error(ErrorKind::argument,
                  fmt::format("shapers of several axes have mean delays of {:g} s and {:g} s, must be equal", other_s,
                              mean_delay_s));
    }
    half_shapers.push_back(shaper.on_finer_grid(2));
    longest_ = std::max(longest_, half_shapers.back().duration_samples());
  }
  if (along.shapers) following = along.shapers->on_finer_grid(2);
  const std::size_t nodes = following ? following->position_mm().size() : 1;
  for (std::size_t node = 0; node < nodes; ++node) {
    auto& kernel = kernels.emplace_back();
    for (std::size_t axis = 0; axis < axis_count; ++axis) {
      std::vector<Mode> here = axis_modes[axis];
      for (std::size_t m = 0; following && m < std::min(here.size(), along.tables[axis].size()); ++m) {
        const ModeTable& table = along.tables[axis][m];
        if (!table.empty() && table.axis == following->axis()) {
          here[m] = mode_at(here[m], table, following->position_mm()[node]);
        }
      }
      for (std::size_t commanded = 0; commanded < axis_count; ++commanded) {
        const Fir& shaper = following ? following->fir().set()[node] : half_shapers[commanded];
        kernel[axis][commanded] = contour_kernel(shaper, here, half_period_s, target, {axis, commanded});
        crosses = crosses || (commanded != axis && !kernel[axis][commanded].empty());
      }
    }
  }
}

}  // namespace shapegcode
