#pragma once

#include <cstddef>

#include "shapegcode/samples.hpp"

namespace shapegcode {

/// What a plant does while its command stands still.
struct RestVibration {
  double begin_s = 0.0;                   ///< the command stands still from here on
  double observed_s = 0.0;                ///< for so long
  Vector3 residual_mm = Vector3::Zero();  ///< largest |response - command|
  /// From the beginning of the rest until |response - command| stays within the band; NaN where it still left the band
  /// in the last eighth of what was observed, so that nothing shows that it stays.
  Vector3 settling_s = Vector3::Zero();
};

/// Follows |response - command| of X, Y and Z from sample to sample. Maxima between samples count: at a local maximum
/// the parabola through three samples gives the height (for a wave of 8 samples per period exact to 0.5 %).
class VibrationWatch {
 public:
  /// A rest is where the command moves no axis by more than 1e-9 mm per period. Throws Error(argument) unless period
  /// and band are > 0.
  VibrationWatch(double period_s, double band_mm);

  /// Whether a next sample of the command would end its rest.
  [[nodiscard]] bool moves(const Vector3& command) const noexcept;
  /// Takes the next sample. Returns |response - command| at it, or just before it if that is larger, mm.
  Vector3 step(const Vector3& command, const Vector3& response) noexcept;
  /// The rest in which the command stands now; `observed_s` 0 while it moves.
  [[nodiscard]] RestVibration rest() const noexcept;

 private:
  double period_;
  double band_;
  std::size_t count_ = 0;
  std::size_t rest_begin_ = 0;  // sample at which the command came to rest
  Vector3 residual_ = Vector3::Zero();
  Vector3 outside_ = Vector3::Constant(-1.0);  // last sample outside of the band
  Vector3 last_command_ = Vector3::Zero();
  Vector3 last_ = Vector3::Zero();  // response - command, one and two samples ago
  Vector3 before_last_ = Vector3::Zero();
};

}  // namespace shapegcode
