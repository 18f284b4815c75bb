#include "shapegcode/identification/modal_fit.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <sstream>
#include <string>
#include <utility>

#include "identification/fit_common.hpp"
#include "identification/one_pole.hpp"
#include "identification/separable_fit.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using identification::mode_terms;
using identification::ModeTerms;
using identification::one_pole;
using identification::OnePole;

/// Response of a mode of unit mass, in `column`, and its derivatives to ln omega and ln zeta in the two others. Written
/// in real numbers: complex products of the standard look for NaN at each sample.
void mode_columns(std::span<const double> force, double period_s, double omega, double zeta, int order,
                  Eigen::Ref<VectorXd> column, Eigen::Ref<VectorXd> to_omega, Eigen::Ref<VectorXd> to_zeta) {
  const ModeTerms terms = mode_terms(omega, zeta, order);
  const OnePole pole = one_pole(terms.pole, period_s);
  const double direct = order == 2 ? 1.0 : 0.0;
  const Complex w_omega = terms.take * terms.d_pole[0];
  const Complex w_zeta = terms.take * terms.d_pole[1];
  const double ar = pole.advance.real(), ai = pole.advance.imag();
  const double br = pole.d_advance.real(), bi = pole.d_advance.imag();
  double zr = 0.0, zi = 0.0, wr = 0.0, wi = 0.0;
  for (std::size_t k = 0; k < force.size(); ++k) {
    const auto row = static_cast<Index>(k);
    column[row] = terms.take.real() * zi + terms.take.imag() * zr + direct * force[k];
    to_omega[row] =
        terms.d_take[0].real() * zi + terms.d_take[0].imag() * zr + w_omega.real() * wi + w_omega.imag() * wr;
    to_zeta[row] = terms.d_take[1].real() * zi + terms.d_take[1].imag() * zr + w_zeta.real() * wi + w_zeta.imag() * wr;
    if (k + 1 == force.size()) break;
    const double now = force[k], next = force[k + 1];
    const double vr = ar * wr - ai * wi + br * zr - bi * zi + pole.d_now.real() * now + pole.d_next.real() * next;
    const double vi = ar * wi + ai * wr + br * zi + bi * zr + pole.d_now.imag() * now + pole.d_next.imag() * next;
    const double yr = ar * zr - ai * zi + pole.now.real() * now + pole.next.real() * next;
    const double yi = ar * zi + ai * zr + pole.now.imag() * now + pole.next.imag() * next;
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
      MatrixXd lines(static_cast<Index>(tap.force_n.size()), extra());
      Index column = 0;
      if (options.with_mass_line) lines.col(column++) = mass_line(tap.force_n, period_s, options.quantity);
      if (options.with_compliance) lines.col(column) = compliance_line(tap.force_n, period_s, options.quantity);
      lines_.push_back(std::move(lines));
    }
  }

  [[nodiscard]] Index extra() const { return (options_.with_mass_line ? 1 : 0) + (options_.with_compliance ? 1 : 0); }
  [[nodiscard]] std::size_t records() const override { return taps_.size(); }
  [[nodiscard]] Index samples(std::size_t record) const override {
    return static_cast<Index>(taps_[record].response.size());
  }
  [[nodiscard]] Index local() const override { return options_.with_offset ? 1 : 0; }
  [[nodiscard]] Index common() const override { return modes_ + extra(); }
  [[nodiscard]] Index derivatives() const override { return 2 * modes_; }
  [[nodiscard]] Index nonlinear() const override { return 2 * modes_; }

  void fill(const VectorXd& theta, std::size_t record, MatrixXd& columns) const override {
    const TapSignals& tap = taps_[record];
    if (options_.with_offset) columns.col(0).setOnes();
    const Index first = local();
    const Index derivative = first + common();
    for (Index m = 0; m < modes_; ++m) {
      mode_columns(tap.force_n, period_s_, std::exp(theta[2 * m]), std::exp(theta[2 * m + 1]),
                   static_cast<int>(options_.quantity), columns.col(first + m), columns.col(derivative + 2 * m),
                   columns.col(derivative + 2 * m + 1));
    }
    columns.middleCols(first + modes_, extra()) = lines_[record];
    columns.col(width() - 1) = Eigen::Map<const VectorXd>(tap.response.data(), samples(record));
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
  std::vector<MatrixXd> lines_;
};

/// Response of the fitted model, without offset, to any force.
VectorXd model_response(const ModalFit& fit, std::span<const double> force, double period_s, Quantity quantity) {
  const NaturalModes modes{fit.omega_rad_s, fit.damping_ratio};
  VectorXd response = modal_response(force, period_s, modes, fit.inverse_mass, quantity);
  if (fit.mass_line != 0.0) response += fit.mass_line * mass_line(force, period_s, quantity);
  if (fit.compliance != 0.0) response += fit.compliance * compliance_line(force, period_s, quantity);
  return response;
}

/// What white noise on the force does to the modelled response, to first order: with G the (Toeplitz) matrix from force
/// to response, the fit sees G*noise as an error of the response.
struct ForceNoise {
  MatrixXd middle;             // sum over records of J'G G'J, per N^2
  double mean_variance = 0.0;  // mean of the diagonal of G G', per N^2
};

ForceNoise force_noise(const ModalFit& fit, const identification::SeparableFit& separable, double period_s,
                       Quantity quantity) {
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
      back.col(j) = model_response(fit, force, period_s, quantity).tail(n);
    }
    noise.middle.noalias() += back.transpose() * back;
    std::ranges::fill(force, 0.0);
    force[1] = 1.0;
    const VectorXd impulse = model_response(fit, force, period_s, quantity).tail(n);
    for (Index k = 0; k < n; ++k) noise.mean_variance += static_cast<double>(n - k) * impulse[k] * impulse[k];
    samples += static_cast<double>(n);
  }
  noise.mean_variance /= samples;
  return noise;
}

/// Covariance of (omega, zeta, 1/m) of each mode in turn.
MatrixXd covariance_of(const ModalFit& fit, const identification::SeparableFit& separable, double period_s,
                       const ModalFitOptions& options) {
  const auto modes = static_cast<Index>(fit.omega_rad_s.size());
  const double freedom = static_cast<double>(fit.quality.samples - fit.quality.parameters);
  const double variance = separable.sum_of_squares / freedom;
  MatrixXd logarithmic;
  if (options.force_noise_n > 0.0) {
    const ForceNoise noise = force_noise(fit, separable, period_s, options.quantity);
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

}  // namespace

ModalFit fit_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& start,
                   const ModalFitOptions& options) {
  check_period(period_s);
  identification::check_modes(start, period_s);
  if (!(options.force_noise_n >= 0.0) || !std::isfinite(options.force_noise_n)) {
    std::ostringstream message;
    message << "noise of the force is " << options.force_noise_n << " N, must be finite and at least 0";
    throw Error(ErrorKind::argument, message.str());
  }
  const TapModel model(taps, period_s, start.omega_rad_s.size(), options);
  check_taps(taps, static_cast<std::size_t>(model.width()));
  const auto own = static_cast<std::size_t>(model.local()) * taps.size();
  const std::size_t parameters = own + static_cast<std::size_t>(model.common() + model.nonlinear());
  std::size_t samples = 0;
  for (const TapSignals& tap : taps) samples += tap.response.size();
  identification::check_enough(samples, parameters);

  identification::SeparableFit separable =
      identification::fit_separable(model, identification::logarithms(start), options.most_iterations);
  NaturalModes found = identification::from_logarithms(separable.theta);
  ModalFit fit;
  fit.omega_rad_s = std::move(found.omega_rad_s);
  fit.damping_ratio = std::move(found.damping_ratio);
  const auto modes = static_cast<Index>(start.omega_rad_s.size());
  fit.inverse_mass.assign(separable.common.begin(), separable.common.begin() + modes);
  if (options.with_mass_line) fit.mass_line = separable.common[modes];
  if (options.with_compliance) fit.compliance = separable.common[model.common() - 1];
  for (const VectorXd& local : separable.local) fit.offset.push_back(options.with_offset ? local[0] : 0.0);
  fit.quality = identification::quality_of(separable, parameters);
  fit.covariance = covariance_of(fit, separable, period_s, options);
  return fit;
}

Eigen::VectorXd modal_response(std::span<const double> force_n, double period_s, const NaturalModes& modes,
                               std::span<const double> inverse_mass, Quantity quantity) {
  check_period(period_s);
  identification::check_modes(modes, period_s);
  if (inverse_mass.size() != modes.omega_rad_s.size()) {
    throw Error(ErrorKind::argument, std::to_string(inverse_mass.size()) + " residues for " +
                                         std::to_string(modes.omega_rad_s.size()) + " modes");
  }
  VectorXd response = VectorXd::Zero(static_cast<Index>(force_n.size()));
  const int order = static_cast<int>(quantity);
  for (std::size_t m = 0; m < inverse_mass.size(); ++m) {
    const ModeTerms terms = mode_terms(modes.omega_rad_s[m], modes.damping_ratio[m], order);
    const OnePole pole = one_pole(terms.pole, period_s);
    Complex state;
    for (std::size_t k = 0; k < force_n.size(); ++k) {
      const double direct = order == 2 ? force_n[k] : 0.0;
      response[static_cast<Index>(k)] += inverse_mass[m] * ((terms.take * state).imag() + direct);
      if (k + 1 < force_n.size()) state = pole.advance * state + pole.now * force_n[k] + pole.next * force_n[k + 1];
    }
  }
  return response;
}

}  // namespace shapegcode
