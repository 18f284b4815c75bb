#include "shapegcode/identify/equivalent_mass.hpp"

#include <algorithm>
#include <cmath>

#include "base/refuse.hpp"
#include "identify/signals.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

void check_positive(double value, const char* what) {
  if (!(value > 0.0 && std::isfinite(value))) refuse("{} is {:g}, must be finite and above 0", what, value);
}

void check_oscillator(const EquivalentOscillator& oscillator) {
  check_positive(oscillator.mass_kg, "mass in kg");
  check_positive(oscillator.stiffness_n_per_m, "stiffness in N/m");
  const double damping = oscillator.damping_n_s_per_m;
  if (!(damping >= 0.0) || !std::isfinite(damping)) {
    refuse("damping is {:g} N s/m, must be finite and at least 0", damping);
  }
}

double rms(std::span<const double> values) {
  double squares = 0.0;
  for (const double value : values) squares += value * value;
  return std::sqrt(squares / static_cast<double>(values.size()));
}

/// RMS of the response of a mass with the problem's frequency and damping.
class SimulatedRms {
 public:
  explicit SimulatedRms(const MassProblem& problem) : problem_(problem) {
    check_period(problem.period_s);
    if (!std::isfinite(problem.impulse_n_s)) refuse("impulse is not finite");
    const std::span<const double> responses[] = {problem.tap.response};
    const TapSignals taps[] = {problem.tap};
    if (problem.impulse_n_s == 0.0 || problem.tap.force_n.size() != problem.tap.response.size()) {
      check_taps(taps, 2);
    } else {
      check_responses(responses, 2);
    }
    check_positive(problem.omega_rad_s, "natural frequency in rad/s");
    if (!(problem.damping_ratio >= 0.0) || !(problem.damping_ratio <= 1.0)) {
      refuse("damping ratio is {:g}, must be between 0 and 1", problem.damping_ratio);
    }
    measured_ = rms(problem.tap.response);
    if (measured_ == 0.0) refuse("response is zero throughout");
  }

  [[nodiscard]] double measured() const { return measured_; }

  [[nodiscard]] double at(double mass_kg) const {
    const double omega = problem_.omega_rad_s;
    const EquivalentOscillator oscillator{mass_kg, 2.0 * problem_.damping_ratio * omega * mass_kg,
                                          omega * omega * mass_kg};
    const OscillatorMotion motion = wilson_theta(oscillator, problem_.tap.force_n, problem_.period_s, problem_.theta,
                                                 0.0, problem_.impulse_n_s / mass_kg);
    const Eigen::VectorXd& values = problem_.quantity == Quantity::acceleration ? motion.acceleration_m_per_s2
                                    : problem_.quantity == Quantity::velocity   ? motion.velocity_m_per_s
                                                                                : motion.displacement_m;
    return rms({values.data(), static_cast<std::size_t>(values.size())});
  }

 private:
  MassProblem problem_;
  double measured_ = 0.0;
};

}  // namespace

OscillatorMotion wilson_theta(const EquivalentOscillator& oscillator, std::span<const double> force_n, double period_s,
                              double theta, double displacement_m, double velocity_m_per_s) {
  check_period(period_s);
  check_oscillator(oscillator);
  if (!(theta >= 1.0) || !std::isfinite(theta)) refuse("theta is {:g}, must be finite and at least 1", theta);
  if (!std::isfinite(displacement_m) || !std::isfinite(velocity_m_per_s)) {
    refuse("start is {} m, {} m/s, must be finite", displacement_m, velocity_m_per_s);
  }
  if (force_n.empty()) refuse("force is empty");
  check_finite(force_n, "force");
  const double m = oscillator.mass_kg;
  const double c = oscillator.damping_n_s_per_m;
  const double k = oscillator.stiffness_n_per_m;
  const double span_s = theta * period_s;
  const double effective = k + 6.0 * m / (span_s * span_s) + 3.0 * c / span_s;
  const auto n = static_cast<Eigen::Index>(force_n.size());
  OscillatorMotion motion{Eigen::VectorXd(n), Eigen::VectorXd(n), Eigen::VectorXd(n)};
  double x = displacement_m;
  double v = velocity_m_per_s;
  double a = (force_n[0] - c * v - k * x) / m;
  for (Eigen::Index i = 0; i < n; ++i) {
    motion.displacement_m[i] = x;
    motion.velocity_m_per_s[i] = v;
    motion.acceleration_m_per_s2[i] = a;
    if (i + 1 == n) break;
    const double now = force_n[static_cast<std::size_t>(i)];
    const double next = force_n[static_cast<std::size_t>(i) + 1];
    const double load = now + theta * (next - now) + m * (6.0 / (span_s * span_s) * x + 6.0 / span_s * v + 2.0 * a) +
                        c * (3.0 / span_s * x + 2.0 * v + 0.5 * span_s * a);
    const double ahead = load / effective;  // displacement theta periods on
    const double a_ahead = 6.0 / (span_s * span_s) * (ahead - x) - 6.0 / span_s * v - 2.0 * a;
    const double a_next = a + (a_ahead - a) / theta;
    x += period_s * v + period_s * period_s / 6.0 * (a_next + 2.0 * a);
    v += 0.5 * period_s * (a + a_next);
    a = a_next;
  }
  return motion;
}

EquivalentMass equivalent_mass_closed_form(const MassProblem& problem) {
  const SimulatedRms simulated(problem);
  const double mass_kg = simulated.at(1.0) / simulated.measured();
  return {mass_kg, simulated.measured(), simulated.measured(), 0, true};
}

EquivalentMass equivalent_mass_bisection(const MassProblem& problem, const MassSearch& search) {
  check_positive(search.low_kg, "lower end of the masses in kg");
  check_positive(search.high_kg - search.low_kg, "width of the range of masses in kg");
  check_positive(search.tolerance, "tolerance of the RMS");
  const SimulatedRms simulated(problem);
  EquivalentMass result;
  result.measured_rms = simulated.measured();
  double low = search.low_kg;
  double high = search.high_kg;
  while (true) {
    result.mass_kg = 0.5 * (low + high);
    result.simulated_rms = simulated.at(result.mass_kg);
    result.converged = std::abs(result.measured_rms - result.simulated_rms) < search.tolerance * result.measured_rms;
    if (result.converged || result.halvings >= search.most_halvings) break;
    // Too much motion: too little mass.
    (result.simulated_rms >= result.measured_rms ? low : high) = result.mass_kg;
    result.halvings += 1;
  }
  return result;
}

}  // namespace shapegcode
