#include "shapegcode/command.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "filter/dense.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode {
namespace {

constexpr double tail_share = 1e-4;
constexpr std::size_t tail_shapers = 4;

}  // namespace

std::vector<double> contour_kernel(const Fir& shaper, std::span<const Mode> modes, double period_s,
                                   ContourTarget target, KernelAxes of) {
  std::vector<double> kernel = dense_taps(shaper);
  const auto moved = static_cast<Eigen::Index>(of.moved);
  const auto commanded = static_cast<Eigen::Index>(of.commanded);
  const bool own = moved == commanded;
  const auto is_excited = [&](const Mode& mode) { return excitation(mode, of.moved)[commanded] != 0.0; };
  if (target != ContourTarget::response || std::ranges::none_of(modes, is_excited)) {
    return own ? kernel : std::vector<double>{};
  }
  AxisModes axes;
  std::ranges::copy_if(modes, std::back_inserter(axes[of.moved]), is_excited);
  ModalPlant plant(axes, period_s);
  plant.reset(Vector3::Zero());
  const std::size_t longest = tail_shapers * kernel.size() + 2;
  const std::size_t shaped = kernel.size();
  kernel.resize(longest, 0.0);
  for (double& tap : kernel) {
    tap = plant.step(tap * Vector3::Unit(commanded))[moved];
  }
  std::size_t size = longest;
  double rest = 0.0;
  while (size > shaped && rest + std::abs(kernel[size - 1]) <= tail_share) {
    rest += std::abs(kernel[--size]);
  }
  kernel.resize(size);
  // A base-excited mode follows a constant velocity without delay, whatever was cut off: sum and mean are the shaper's,
  // or zero if another axis moves.
  double sum = 0.0;
  double moment = 0.0;
  for (std::size_t k = 0; k < kernel.size(); ++k) {
    sum += kernel[k];
    moment += kernel[k] * static_cast<double>(k);
  }
  const double behind = ((own ? shaper.mean_samples() : 0.0) - moment) / static_cast<double>(kernel.size() - 1);
  kernel.back() += behind;
  kernel.front() += (own ? 1.0 : 0.0) - sum - behind;
  return kernel;
}

}  // namespace shapegcode
