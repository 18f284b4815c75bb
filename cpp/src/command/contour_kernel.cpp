#include "shapegcode/command.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "filter/dense.hpp"
#include "shapegcode/plant/modal.hpp"

namespace shapegcode {
namespace {

constexpr double tail_share = 1e-4;
constexpr std::size_t tail_shapers = 4;

}  // namespace

std::vector<double> contour_kernel(const Fir& shaper, std::span<const Mode> modes, double period_s,
                                   ContourTarget target) {
  std::vector<double> kernel = dense_taps(shaper);
  if (target != ContourTarget::response || modes.empty()) {
    return kernel;
  }
  AxisModes axes;
  axes[0].assign(modes.begin(), modes.end());
  ModalPlant plant(axes, period_s);
  plant.reset(Vector3::Zero());
  const std::size_t longest = tail_shapers * kernel.size() + 2;
  const std::size_t shaped = kernel.size();
  kernel.resize(longest, 0.0);
  for (double& tap : kernel) {
    tap = plant.step(Vector3(tap, 0.0, 0.0))[0];
  }
  std::size_t size = longest;
  double rest = 0.0;
  while (size > shaped && rest + std::abs(kernel[size - 1]) <= tail_share) {
    rest += std::abs(kernel[--size]);
  }
  kernel.resize(size);
  // A base-excited mode follows a steady motion without delay, whatever was cut off: sum and mean are the shaper's.
  double sum = 0.0;
  double moment = 0.0;
  for (std::size_t k = 0; k < kernel.size(); ++k) {
    sum += kernel[k];
    moment += kernel[k] * static_cast<double>(k);
  }
  const double behind = (shaper.mean_samples() - moment) / static_cast<double>(kernel.size() - 1);
  kernel.back() += behind;
  kernel.front() += 1.0 - sum - behind;
  return kernel;
}

}  // namespace shapegcode
