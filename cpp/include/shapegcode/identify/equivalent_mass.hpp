#pragma once

#include <span>

#include <Eigen/Core>

#include "shapegcode/identify/arma.hpp"

namespace shapegcode {

/// One body on spring and damper.
struct EquivalentOscillator {
  double mass_kg;
  double damping_n_s_per_m;
  double stiffness_n_per_m;
};

/// Motion at the instants of the force.
struct OscillatorMotion {
  Eigen::VectorXd displacement_m;
  Eigen::VectorXd velocity_m_per_s;
  Eigen::VectorXd acceleration_m_per_s2;
};

/// Step-by-step integration of m x'' + c x' + k x = force (N) by the Wilson theta method: acceleration linear over
/// theta periods. The first sample's state is `displacement_m` and `velocity_m_per_s` with the acceleration that
/// balances the forces. Unconditionally stable from theta = 1.37 on; it lengthens the period of oscillation and adds
/// a little damping.
///
/// Throws Error(argument) on an empty force or one that is not finite, a mass, stiffness or period that is not above 0,
/// damping below 0 or theta below 1. Source: paper 003, section 2.2; K.-J. Bathe, Finite Element Procedures, 9.2.
[[nodiscard]] OscillatorMotion wilson_theta(const EquivalentOscillator& oscillator, std::span<const double> force_n,
                                            double period_s, double theta = 1.4, double displacement_m = 0.0,
                                            double velocity_m_per_s = 0.0);

/// The measured response (m, m/s or m/s²), and the natural frequency and damping ratio of the oscillator.
struct MassProblem {
  TapSignals tap;
  double period_s;
  double omega_rad_s;
  double damping_ratio;
  Quantity quantity = Quantity::acceleration;
  double theta = 1.4;  ///< of the Wilson theta method
  double impulse_n_s =
      0.0;  ///< in addition to the force: an impulse just before the first sample, too short to be sampled
};

/// Range of the bisection for the mass, and when it stops.
struct MassSearch {
  double low_kg = 1e-3;
  double high_kg = 1e3;
  double tolerance = 0.01;  ///< of the measured RMS
  int most_halvings = 100;
};

struct EquivalentMass {
  double mass_kg = 0.0;
  double measured_rms = 0.0;   ///< of the response, in its unit
  double simulated_rms = 0.0;  ///< of the Wilson theta response with this mass
  int halvings = 0;            ///< halvings of the range of masses; 0 in closed form
  bool converged = false;      ///< the RMS agree within the tolerance
};

/// Mass with which the oscillator responds to the force with the measured RMS. The response is proportional to 1/m, so
/// one simulation with 1 kg is sufficient: m = its RMS / measured RMS.
///
/// Throws Error(argument) on signals that arma_driven refuses (with an impulse, the force may be zero), a response that
/// is zero throughout, a frequency that is not above 0, a damping ratio outside 0 ... 1, and as wilson_theta. Source:
/// paper 003, section 2.2; the closed form: this project.
[[nodiscard]] EquivalentMass equivalent_mass_closed_form(const MassProblem& problem);

/// The same by halving the range of masses until the RMS agree: paper 003, steps 1 to 7, as a check. Also throws
/// on a range or tolerance that is not positive. A range without solution ends at one of its ends, not converged.
[[nodiscard]] EquivalentMass equivalent_mass_bisection(const MassProblem& problem, const MassSearch& search);

}  // namespace shapegcode
