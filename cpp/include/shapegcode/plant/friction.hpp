#pragma once

#include <cmath>
#include <cstdint>

namespace shapegcode {

/// How a sliding pair resists.
enum class FrictionModel : std::uint8_t {
  viscous,   ///< in proportion to the speed alone
  stribeck,  ///< Coulomb, static and Stribeck as a function of the speed, made smooth through zero
  lugre,     ///< the same with bristles between the surfaces: presliding, stick, frictional lag; one state
};

/// Friction of one sliding pair, SI. Curve of the steady speed v:
/// F(v) = sign(v) * (coulomb + (static - coulomb) * exp(-(v/stribeck_velocity)^2)) + viscous * v.
struct FrictionParameters {
  FrictionModel model = FrictionModel::viscous;
  double viscous_n_s_per_m = 0.0;           ///< >= 0
  double coulomb_n = 0.0;                   ///< sliding friction; > 0 unless viscous
  double static_n = 0.0;                    ///< friction to be overcome from rest; >= coulomb_n
  double stribeck_velocity_m_per_s = 0.0;   ///< speed at which static has given way to sliding friction; > 0
  double smoothing_velocity_m_per_s = 0.0;  ///< Stribeck: sign(v) is tanh(v / this); > 0
  double bristle_stiffness_n_per_m = 0.0;   ///< LuGre, sigma0: force over displacement before sliding; > 0
  double bristle_damping_n_s_per_m = 0.0;   ///< LuGre, sigma1; >= 0

  /// Throws Error(argument) with the value and its limit; `place` begins the message ("friction of the table").
  void check(const char* place) const;
  [[nodiscard]] bool has_bristles() const noexcept { return model == FrictionModel::lugre; }
};

/// Force against the motion and its derivatives.
struct FrictionForce {
  double force_n = 0.0;
  double by_velocity = 0.0;           ///< N/(m/s)
  double by_bristle = 0.0;            ///< N/m
  double bristle_rate_m_per_s = 0.0;  ///< of the bristles' deflection
  double rate_by_velocity = 0.0;
  double rate_by_bristle = 0.0;  ///< 1/s
};

/// Force at a speed (m/s) and, with LuGre, a deflection of the bristles (m). LuGre after Canudas de Wit, Olsson, Astrom
/// and Lischinsky (1995): z' = v - sigma0 |v| z / g(v), F = sigma0 z + sigma1 z' + viscous v, g the curve above.
[[nodiscard]] FrictionForce friction_force(const FrictionParameters& friction, double velocity_m_per_s,
                                           double bristle_m) noexcept;

}  // namespace shapegcode
