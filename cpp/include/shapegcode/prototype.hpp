#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/filter.hpp"
#include "shapegcode/mode.hpp"
#include "shapegcode/motion.hpp"
#include "shapegcode/path.hpp"
#include "shapegcode/plant/modal.hpp"
#include "shapegcode/samples.hpp"
#include "shapegcode/shaper.hpp"

// A start for controller prototypes: plan, step, filter, plant.
//
//     using namespace shapegcode;
//     const std::vector modes = {Mode{46.0, 0.02, 1.0}, Mode{131.0, 0.02, 1.0}};
//     Path path({make_line({0, 0, 0}, {40, 0, 0}, 200.0), make_line({40, 0, 0}, {40, 40, 0}, 200.0)});
//     ShapedMotion motion(std::move(path), MotionLimits{}, modes, 0.005);
//     ModalPlant machine({modes, modes, {}}, 0.005);  // stands in for the machine
//     Vector3 set_point, table;
//     machine.reset(Vector3::Zero());
//     while (motion.step(values_of(set_point))) {      // your interpolation task, every 5 ms
//       machine.step(values_of(set_point), values_of(table));
//     }

namespace shapegcode {

/// A path from rest to rest as a control runs it: look-ahead over the whole path at the start, then one set-point per
/// period, through a shaper whose zeros lie exactly on the modes. `step` is real-time safe: no allocation, no
/// exception, no lock, bounded work.
class ShapedMotion {
 public:
  /// With a shaper of your own: any filter on the grid of the period. Throws Error(argument) as plan_speed and
  /// Interpolator do, and on a path without segments.
  ShapedMotion(Path path, const MotionLimits& limits, Fir shaper, double period_s)
      : ShapedMotion(std::make_shared<const Path>(std::move(path)), limits, std::move(shaper), period_s) {}

  /// With the shortest filter on this grid that has a zero on every mode (grid_polynomial). If the period is much
  /// shorter than those of the modes, its taps are large and of both signs: pass a filter of your own then. Throws
  /// Error(design) if there is none.
  ShapedMotion(Path path, const MotionLimits& limits, std::span<const Mode> modes, double period_s)
      : ShapedMotion(std::move(path), limits, to_fir(grid_polynomial(modes, period_s), period_s), period_s) {}

  /// Next set-point in mm, `out` of axis_count values. False after the last one; `out` is then the end.
  bool step(std::span<double> out) noexcept {
    const bool moving = interpolator_.step(out);
    stream_.step(out, out);
    if (!moving && tail_ == 0) return false;
    if (!moving) --tail_;
    return true;
  }
  /// Number of set-points from start to end: those of the path plus the shaper duration.
  [[nodiscard]] std::size_t sample_count() const noexcept {
    return interpolator_.sample_count() + static_cast<std::size_t>(stream_.fir().duration_samples());
  }
  [[nodiscard]] const Fir& shaper() const noexcept { return stream_.fir(); }

 private:
  ShapedMotion(const std::shared_ptr<const Path>& path, const MotionLimits& limits, Fir shaper, double period_s)
      : interpolator_(checked(path), std::make_shared<const SpeedProfile>(plan_speed(*path, limits)), period_s),
        stream_(std::move(shaper), axis_count),
        tail_(stream_.fir().duration_samples()) {
    Vector3 start = (*path)[0].start_mm;
    stream_.reset(values_of(start));
  }

  static const std::shared_ptr<const Path>& checked(const std::shared_ptr<const Path>& path) {
    if (path->size() == 0) throw Error(ErrorKind::argument, "a path without segments has no motion");
    return path;
  }

  Interpolator interpolator_;
  FirStream stream_;
  int tail_;
};

}  // namespace shapegcode
