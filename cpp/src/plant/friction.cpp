#include "shapegcode/plant/feed_drive.hpp"

#include <cmath>
#include <string>

#include "base/checks.hpp"

namespace shapegcode {

void FrictionParameters::check(const char* part) const {
  const std::string of = std::string(" of the ") + part;
  require_not_below_zero(viscous_n_s_per_m, "viscous friction" + of, "N s/m");
  if (model == FrictionModel::viscous) return;
  require_above_zero(coulomb_n, "Coulomb friction" + of, "N");
  require_above_zero(stribeck_velocity_m_per_s, "Stribeck speed" + of, "m/s");
  require_within(static_n, coulomb_n, unbounded, "static friction" + of, "N");
  if (model == FrictionModel::stribeck) {
    require_above_zero(smoothing_velocity_m_per_s, "smoothing speed of the friction" + of, "m/s");
    return;
  }
  require_above_zero(bristle_stiffness_n_per_m, "stiffness of the bristles" + of, "N/m");
  require_not_below_zero(bristle_damping_n_s_per_m, "damping of the bristles" + of, "N s/m");
}

FrictionForce friction_force(const FrictionParameters& friction, double velocity_m_per_s, double bristle_m) noexcept {
  const double v = velocity_m_per_s;
  FrictionForce result;
  result.force_n = friction.viscous_n_s_per_m * v;
  result.by_velocity = friction.viscous_n_s_per_m;
  if (friction.model == FrictionModel::viscous) return result;

  const double share = v / friction.stribeck_velocity_m_per_s;
  const double excess = (friction.static_n - friction.coulomb_n) * std::exp(-share * share);
  const double level = friction.coulomb_n + excess;
  const double level_slope = -2.0 * excess * share / friction.stribeck_velocity_m_per_s;
  if (friction.model == FrictionModel::stribeck) {
    const double sign = std::tanh(v / friction.smoothing_velocity_m_per_s);
    result.force_n += level * sign;
    result.by_velocity += level_slope * sign + level * (1.0 - sign * sign) / friction.smoothing_velocity_m_per_s;
    return result;
  }
  const double sigma0 = friction.bristle_stiffness_n_per_m;
  const double sigma1 = friction.bristle_damping_n_s_per_m;
  const double sign = v > 0.0 ? 1.0 : (v < 0.0 ? -1.0 : 0.0);
  const double relaxation = sigma0 * std::abs(v) / level;
  result.bristle_rate_m_per_s = v - relaxation * bristle_m;
  result.rate_by_bristle = -relaxation;
  result.rate_by_velocity = 1.0 - bristle_m * (sigma0 * sign - relaxation * level_slope) / level;
  result.force_n += sigma0 * bristle_m + sigma1 * result.bristle_rate_m_per_s;
  result.by_velocity += sigma1 * result.rate_by_velocity;
  result.by_bristle = sigma0 + sigma1 * result.rate_by_bristle;
  return result;
}

}  // namespace shapegcode
