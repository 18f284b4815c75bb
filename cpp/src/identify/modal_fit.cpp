#include "shapegcode/identify/modal_fit.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <sstream>
#include <utility>

#include "base/refuse.hpp"
#include "identify/fit_common.hpp"
#include "identify/held_force.hpp"
#include "identify/one_pole.hpp"
#include "identify/separable_fit.hpp"
#include "identify/signals.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::HeldForce;
using identification::mode_terms;
using identification::ModeTerms;
using identification::one_pole;
using identification::OnePole;

/// Contribution of the force within a period to a mode's state z (mode_terms) at its end, and to dz/ds: weights of the
/// force at the ends of the parts of the period.
class PeriodInput {
 public:
  PeriodInput(Complex pole, double period_s, std::size_t steps) : weight_(steps + 1), derivative_(steps + 1) {
    const OnePole part = one_pole(pole, period_s / static_cast<double>(steps));
    // A part's input is carried on over the parts behind it.
    Complex carry = 1.0;
    Complex d_carry = 0.0;
    for (std::size_t i = steps; i-- > 0;) {
      weight_[i] += carry * part.now;
      weight_[i + 1] += carry * part.next;
      derivative_[i] += carry * part.d_now + d_carry * part.now;
      derivative_[i + 1] += carry * part.d_next + d_carry * part.next;
      d_carry = d_carry * part.advance + carry * part.d_advance;
      carry *= part.advance;
    }
  }
  [[nodiscard]] Complex state(std::span<const double> force) const { return dot(weight_, force); }
  [[nodiscard]] Complex derivative(std::span<const double> force) const { return dot(derivative_, force); }

 private:
  [[nodiscard]] static Complex dot(const std::vector<Complex>& weights, std::span<const double> force) {
    double real = 0.0, imag = 0.0;
    for (std::size_t i = 0; i < force.size(); ++i) {
      real += weights[i].real() * force[i];
      imag += weights[i].imag() * force[i];
    }
    return {real, imag};
  }
  std::vector<Complex> weight_;
  std::vector<Complex> derivative_;
};

/// A force and how it is taken.
struct Driven {
  const HeldForce& held;
  std::span<const double> force;
  double period_s;
  const ModalFitOptions& options;
};

/// The columns that one mode fills: its response, and the derivatives of that to ln omega and ln zeta if they are
/// wanted.
struct ModeColumns {
  Eigen::Ref<VectorXd>* response;
  Eigen::Ref<VectorXd>* to_omega = nullptr;
  Eigen::Ref<VectorXd>* to_zeta = nullptr;
};

/// Response of a mode of unit mass. Written in real numbers: complex products of the standard look for NaN at each
/// sample.
void fill_mode(const Driven& driven, double omega, double zeta, const ModeColumns& columns) {
  const auto [held, force, period_s, options] = driven;
  const auto [response, to_omega, to_zeta] = columns;
  Eigen::Ref<VectorXd>& column = *response;
  const ModeTerms terms = mode_terms(omega, zeta, static_cast<int>(options.quantity));
  const OnePole pole = one_pole(terms.pole, period_s);
  const PeriodInput input(terms.pole, period_s, held.steps());
  // A blow is over when the response is read: no force then.
  const bool is_impulse = options.hold == ForceHold::impulse;
  const double direct = options.quantity == Quantity::acceleration && !is_impulse ? 1.0 : 0.0;
  const Complex w_omega = terms.take * terms.d_pole[0];
  const Complex w_zeta = terms.take * terms.d_pole[1];
  const double ar = pole.advance.real(), ai = pole.advance.imag();
  const double br = pole.d_advance.real(), bi = pole.d_advance.imag();
  double zr = is_impulse ? period_s * held.blow(0) : 0.0;
  double zi = 0.0, wr = 0.0, wi = 0.0;
  for (std::size_t k = 0; k < force.size(); ++k) {
    const auto row = static_cast<Index>(k);
    column[row] = terms.take.real() * zi + terms.take.imag() * zr + direct * force[k];
    if (to_omega != nullptr) {
      (*to_omega)[row] =
          terms.d_take[0].real() * zi + terms.d_take[0].imag() * zr + w_omega.real() * wi + w_omega.imag() * wr;
      (*to_zeta)[row] =
          terms.d_take[1].real() * zi + terms.d_take[1].imag() * zr + w_zeta.real() * wi + w_zeta.imag() * wr;
    }
    double vr = ar * wr - ai * wi + br * zr - bi * zi;
    double vi = ar * wi + ai * wr + br * zi + bi * zr;
    double yr = ar * zr - ai * zi + period_s * held.blow(k + 1);
    double yi = ar * zi + ai * zr;
    if (const std::span<const double> within = held.within(k); !within.empty()) {
      const Complex y = input.state(within);
      const Complex v = input.derivative(within);
      yr += y.real();
      yi += y.imag();
      vr += v.real();
      vi += v.imag();
    }
    wr = vr;
    wi = vi;
    zr = yr;
    zi = yi;
  }
}

/// Free mass of 1 kg: the force, its integral, or the integral of that, exact for a force linear between samples.
VectorXd mass_line(std::span<const double> force, double period_s, Quantity quantity) {
  VectorXd column(static_cast<Index>(force.size()));
  double velocity = 0.0;
  double displacement = 0.0;
  for (std::size_t k = 0; k < force.size(); ++k) {
    if (k > 0) {
      displacement += period_s * (velocity + period_s * (force[k - 1] / 3.0 + force[k] / 6.0));
      velocity += 0.5 * period_s * (force[k - 1] + force[k]);
    }
    column[static_cast<Index>(k)] = quantity == Quantity::acceleration ? force[k]
                                    : quantity == Quantity::velocity   ? velocity
                                                                       : displacement;
  }
  return column;
}

/// Spring of 1 N/m without mass: the force or its central differences, the force zero before and after the record.
VectorXd compliance_line(std::span<const double> force, double period_s, Quantity quantity) {
  VectorXd column(static_cast<Index>(force.size()));
  for (std::size_t k = 0; k < force.size(); ++k) {
    const double before = k > 0 ? force[k - 1] : 0.0;
    const double after = k + 1 < force.size() ? force[k + 1] : 0.0;
    column[static_cast<Index>(k)] = quantity == Quantity::displacement ? force[k]
                                    : quantity == Quantity::velocity
                                        ? (after - before) / (2.0 * period_s)
                                        : (after - 2.0 * force[k] + before) / (period_s * period_s);
  }
  return column;
}

class TapModel final : public identification::SeparableModel {
 public:
  TapModel(std::span<const TapSignals> taps, double period_s, std::size_t modes, const ModalFitOptions& options)
      : taps_(taps), period_s_(period_s), modes_(static_cast<Index>(modes)), options_(options) {
    for (const TapSignals& tap : taps) {
      held_.emplace_back(tap.force_n, options.hold);
      MatrixXd lines(static_cast<Index>(tap.force_n.size()), extra());
      Index column = 0;
      if (options.with_mass_line) lines.col(column++) = mass_line(tap.force_n, period_s, options.quantity);
      if (options.with_compliance) lines.col(column) = compliance_line(tap.force_n, period_s, options.quantity);
      lines_.push_back(std::move(lines));
    }
  }

  /// Errors of the force become unknowns of each record: one per sample of its pulse, in units of the force's noise.
  /// Each is expected to be 0 with a standard deviation of 1: a row of its own per unknown says so, with the weight of
  /// the response's noise.
  void estimate_force(std::vector<MatrixXd> responses_to_noise, double response_noise) {
    force_columns_ = std::move(responses_to_noise);
    force_errors_ = force_columns_.front().cols();
    response_noise_ = response_noise;
  }

  [[nodiscard]] Index extra() const { return (options_.with_mass_line ? 1 : 0) + (options_.with_compliance ? 1 : 0); }
  [[nodiscard]] std::size_t records() const override { return taps_.size(); }
  [[nodiscard]] Index samples(std::size_t record) const override {
    return static_cast<Index>(taps_[record].response.size()) + force_errors_;
  }
  [[nodiscard]] Index local() const override { return offset() + force_errors_; }
  [[nodiscard]] Index offset() const { return options_.with_offset ? 1 : 0; }
  [[nodiscard]] Index common() const override { return modes_ + extra(); }
  [[nodiscard]] Index derivatives() const override { return 2 * modes_; }
  [[nodiscard]] Index nonlinear() const override { return 2 * modes_; }
  [[nodiscard]] bool local_is_constant() const override { return true; }

  void fill(const VectorXd& theta, std::size_t record, MatrixXd& columns) const override {
    const TapSignals& tap = taps_[record];
    const auto n = static_cast<Index>(tap.response.size());
    if (force_errors_ > 0) {
      columns.bottomRows(force_errors_).setZero();
      columns.bottomRows(force_errors_).middleCols(offset(), force_errors_).diagonal().setConstant(response_noise_);
      columns.topRows(n).middleCols(offset(), force_errors_) = force_columns_[record];
    }
    if (options_.with_offset) columns.col(0).head(n).setOnes();
    const Index first = local();
    const Index derivative = first + common();
    for (Index m = 0; m < modes_; ++m) {
      Eigen::Ref<VectorXd> response(columns.col(first + m).head(n));
      Eigen::Ref<VectorXd> to_omega(columns.col(derivative + 2 * m).head(n));
      Eigen::Ref<VectorXd> to_zeta(columns.col(derivative + 2 * m + 1).head(n));
      fill_mode({held_[record], tap.force_n, period_s_, options_}, std::exp(theta[2 * m]), std::exp(theta[2 * m + 1]),
                {&response, &to_omega, &to_zeta});
    }
    columns.topRows(n).middleCols(first + modes_, extra()) = lines_[record];
    columns.col(width() - 1).head(n) = Eigen::Map<const VectorXd>(tap.response.data(), n);
  }

  [[nodiscard]] MatrixXd combine(const VectorXd& /*theta*/, const VectorXd& /*local_values*/,
                                 const VectorXd& common_values) const override {
    VectorXd gains(2 * modes_);
    for (Index m = 0; m < modes_; ++m) gains.segment(2 * m, 2).setConstant(common_values[m]);
    return gains.asDiagonal();
  }

  bool clamp(VectorXd& theta) const override { return identification::clamp_logarithms(theta, period_s_); }

 private:
  std::span<const TapSignals> taps_;
  double period_s_;
  Index modes_;
  ModalFitOptions options_;
  std::vector<HeldForce> held_;
  std::vector<MatrixXd> lines_;
  std::vector<MatrixXd> force_columns_;  // per record, of what noise on each sample of the pulse does to the response
  Index force_errors_ = 0;
  double response_noise_ = 0.0;
};

/// Response of the fitted model, without offset, to any force.
VectorXd model_response(const ModalFit& fit, std::span<const double> force, double period_s,
                        const ModalFitOptions& options) {
  VectorXd response = VectorXd::Zero(static_cast<Index>(force.size()));
  VectorXd column(response.size());
  Eigen::Ref<VectorXd> filled(column);
  const HeldForce held(force, options.hold);
  for (std::size_t m = 0; m < fit.omega_rad_s.size(); ++m) {
    fill_mode({held, force, period_s, options}, fit.omega_rad_s[m], fit.damping_ratio[m], {&filled});
    response += fit.inverse_mass[m] * column;
  }
  if (fit.mass_line != 0.0) response += fit.mass_line * mass_line(force, period_s, options.quantity);
  if (fit.compliance != 0.0) response += fit.compliance * compliance_line(force, period_s, options.quantity);
  return response;
}

// Rounds in which the noise of the response, and with it the weight of the force, is found; they end when the sum of
// squares changes by less than this share.
constexpr int max_rounds = 4;
constexpr double settled = 1e-3;
// Samples of a pulse whose force is estimated along with the modes.
constexpr std::size_t longest_estimated_pulse = 128;

std::size_t longest_pulse(std::span<const TapSignals> taps) {
  std::size_t longest = 0;
  for (const TapSignals& tap : taps) longest = std::max(longest, identification::pulse_of(tap.force_n).size());
  return longest;
}

/// What noise of `force_noise_n` on each sample of the pulse does to each record: columns of the Toeplitz matrix from
/// force to response. Records with a shorter pulse than the longest have columns of zeros.
std::vector<MatrixXd> responses_to_noise(const ModalFit& fit, std::span<const TapSignals> taps, double period_s,
                                         const ModalFitOptions& options) {
  const auto pulse_samples = static_cast<Index>(longest_pulse(taps));
  std::vector<MatrixXd> columns;
  for (const TapSignals& tap : taps) {
    const std::size_t n = tap.response.size();
    const std::size_t reach = HeldForce::reach(options.hold);
    std::vector<double> force(n + reach, 0.0);
    force[reach] = options.force_noise_n;
    const VectorXd impulse = model_response(fit, force, period_s, options);
    const identification::PulseRange pulse = identification::pulse_of(tap.force_n);
    MatrixXd record = MatrixXd::Zero(static_cast<Index>(n), pulse_samples);
    for (std::size_t j = 0; j < pulse.size(); ++j) {
      // Sample k of the record is sample k - sample + reach of the impulse's response.
      const std::size_t sample = pulse.begin + j;
      const auto from = static_cast<Index>(sample > reach ? sample - reach : 0);
      const auto skipped = static_cast<Index>(sample > reach ? 0 : reach - sample);
      const Index length = std::min(static_cast<Index>(n) - from, impulse.size() - skipped);
      record.col(static_cast<Index>(j)).segment(from, length) = impulse.segment(skipped, length);
    }
    columns.push_back(std::move(record));
  }
  return columns;
}

/// What white noise on the force does to the modelled response, to first order: with G the (Toeplitz) matrix from force
/// to response, the fit sees G*noise as an error of the response.
struct ForceNoise {
  MatrixXd middle;             // sum over records of J'G G'J, per N^2
  double mean_variance = 0.0;  // mean of the diagonal of G G', per N^2
};

ForceNoise force_noise(const ModalFit& fit, const identification::SeparableFit& separable, double period_s,
                       const ModalFitOptions& options) {
  ForceNoise noise;
  noise.middle = MatrixXd::Zero(separable.inverse_gram.rows(), separable.inverse_gram.cols());
  double samples = 0.0;
  for (const MatrixXd& jacobian : separable.jacobian) {
    const Index n = jacobian.rows();
    MatrixXd back(n, jacobian.cols());
    // A leading zero: the force's noise is linear between samples before the first one, too.
    std::vector<double> force(static_cast<std::size_t>(n) + 1, 0.0);
    for (Index j = 0; j < jacobian.cols(); ++j) {
      // The transpose of a Toeplitz matrix is the matrix itself with time running backwards.
      for (Index k = 0; k < n; ++k) force[static_cast<std::size_t>(n - k)] = jacobian(k, j);
      back.col(j) = model_response(fit, force, period_s, options).tail(n);
    }
    noise.middle.noalias() += back.transpose() * back;
    std::ranges::fill(force, 0.0);
    force[1] = 1.0;
    const VectorXd impulse = model_response(fit, force, period_s, options).tail(n);
    for (Index k = 0; k < n; ++k) noise.mean_variance += static_cast<double>(n - k) * impulse[k] * impulse[k];
    samples += static_cast<double>(n);
  }
  noise.mean_variance /= samples;
  return noise;
}

/// Covariance of (omega, zeta, 1/m) of each mode in turn.
MatrixXd covariance_of(const ModalFit& fit, const identification::SeparableFit& separable, double period_s,
                       const ModalFitOptions& options, bool first_order_force_noise) {
  const auto modes = static_cast<Index>(fit.omega_rad_s.size());
  const double freedom = static_cast<double>(fit.quality.samples - fit.quality.parameters);
  const double variance = separable.sum_of_squares / freedom;
  MatrixXd logarithmic;
  if (first_order_force_noise) {
    const ForceNoise noise = force_noise(fit, separable, period_s, options);
    const double force_variance = options.force_noise_n * options.force_noise_n;
    logarithmic =
        options.coloured_residuals
            ? identification::coloured_covariance(separable, freedom)
            : (std::max(variance - force_variance * noise.mean_variance, 0.0) * separable.inverse_gram).eval();
    logarithmic += force_variance * separable.inverse_gram * noise.middle * separable.inverse_gram;
  } else if (options.coloured_residuals) {
    logarithmic = identification::coloured_covariance(separable, freedom);
  } else {
    logarithmic = variance * separable.inverse_gram;
  }
  // From (1/m ..., others, ln omega, ln zeta, ...) to (omega, zeta, 1/m) of each mode.
  const Index first_log = separable.common.size();
  MatrixXd change = MatrixXd::Zero(3 * modes, logarithmic.rows());
  for (Index m = 0; m < modes; ++m) {
    change(3 * m, first_log + 2 * m) = fit.omega_rad_s[static_cast<std::size_t>(m)];
    change(3 * m + 1, first_log + 2 * m + 1) = fit.damping_ratio[static_cast<std::size_t>(m)];
    change(3 * m + 2, m) = 1.0;
  }
  return change * logarithmic * change.transpose();
}

/// Takes the rows of expected force errors, which lie behind the samples, out of the figures of the samples.
void drop_expectations(identification::SeparableFit& fit, std::span<const TapSignals> taps) {
  fit.expectations = MatrixXd::Zero(fit.inverse_gram.rows(), fit.inverse_gram.cols());
  for (std::size_t r = 0; r < taps.size(); ++r) {
    const auto n = static_cast<Index>(taps[r].response.size());
    const MatrixXd expected = fit.jacobian[r].bottomRows(fit.jacobian[r].rows() - n);
    fit.expectations.noalias() += expected.transpose() * expected;
    fit.fitted[r].conservativeResize(n);
    fit.residual[r].conservativeResize(n);
    fit.jacobian[r].conservativeResize(n, Eigen::NoChange);
  }
}

}  // namespace

ModalFit fit_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& start,
                   const ModalFitOptions& options) {
  check_period(period_s);
  identification::check_modes(start, period_s);
  if (!(options.force_noise_n >= 0.0) || !std::isfinite(options.force_noise_n)) {
    refuse("noise of the force is {:g} N, must be finite and at least 0", options.force_noise_n);
  }
  TapModel model(taps, period_s, start.omega_rad_s.size(), options);
  check_taps(taps, static_cast<std::size_t>(model.width()));
  const auto own = static_cast<std::size_t>(model.local()) * taps.size();
  const std::size_t parameters = own + static_cast<std::size_t>(model.common() + model.nonlinear());
  std::size_t samples = 0;
  for (const TapSignals& tap : taps) samples += tap.response.size();
  identification::check_enough(samples, parameters);

  ModalFit fit;
  const auto search = [&](const NaturalModes& from) {
    identification::SeparableFit separable =
        identification::fit_separable(model, identification::logarithms(from), options.most_iterations);
    NaturalModes found = identification::from_logarithms(separable.theta);
    fit.omega_rad_s = std::move(found.omega_rad_s);
    fit.damping_ratio = std::move(found.damping_ratio);
    const auto modes = static_cast<Index>(start.omega_rad_s.size());
    fit.inverse_mass.assign(separable.common.begin(), separable.common.begin() + modes);
    if (options.with_mass_line) fit.mass_line = separable.common[modes];
    if (options.with_compliance) fit.compliance = separable.common[model.common() - 1];
    return separable;
  };
  identification::SeparableFit separable = search(start);
  const bool estimates_force = options.force_noise_n > 0.0 && longest_pulse(taps) <= longest_estimated_pulse;
  const auto freedom = static_cast<double>(samples - parameters);
  for (int round = 0; estimates_force && round < max_rounds; ++round) {
    const double before = separable.sum_of_squares;
    if (!(before > 0.0)) break;
    model.estimate_force(responses_to_noise(fit, taps, period_s, options), std::sqrt(before / freedom));
    separable = search({fit.omega_rad_s, fit.damping_ratio});
    if (std::abs(separable.sum_of_squares - before) < settled * before) break;
  }
  for (const VectorXd& local : separable.local) fit.offset.push_back(options.with_offset ? local[0] : 0.0);
  drop_expectations(separable, taps);
  fit.quality = identification::quality_of(separable, parameters);
  fit.covariance = covariance_of(fit, separable, period_s, options, options.force_noise_n > 0.0 && !estimates_force);
  return fit;
}

Eigen::VectorXd modal_response(std::span<const double> force_n, double period_s, const NaturalModes& modes,
                               std::span<const double> inverse_mass, Quantity quantity, ForceHold hold) {
  check_period(period_s);
  identification::check_modes(modes, period_s);
  if (inverse_mass.size() != modes.omega_rad_s.size()) {
    refuse("{} residues for {} modes", inverse_mass.size(), modes.omega_rad_s.size());
  }
  check_finite(force_n, "force");
  check_finite(inverse_mass, "1/m");
  ModalFit fit;
  fit.omega_rad_s = modes.omega_rad_s;
  fit.damping_ratio = modes.damping_ratio;
  fit.inverse_mass.assign(inverse_mass.begin(), inverse_mass.end());
  ModalFitOptions options;
  options.quantity = quantity;
  options.hold = hold;
  return model_response(fit, force_n, period_s, options);
}

}  // namespace shapegcode
