#include "shapegcode/identify/modal_fit.hpp"

#include <cmath>
#include <complex>
#include <utility>

#include "identify/fit_common.hpp"
#include "identify/one_pole.hpp"
#include "identify/separable_fit.hpp"
#include "identify/signals.hpp"

namespace shapegcode {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Response Re(C exp(s t)) per mode: the linear parameters are Re C and Im C.
class DecayModel final : public identification::SeparableModel {
 public:
  DecayModel(Responses responses, double period_s, std::size_t modes, bool with_offset)
      : responses_(responses), period_s_(period_s), modes_(static_cast<Index>(modes)), with_offset_(with_offset) {}

  [[nodiscard]] std::size_t records() const override { return responses_.size(); }
  [[nodiscard]] Index samples(std::size_t record) const override {
    return static_cast<Index>(responses_[record].size());
  }
  [[nodiscard]] Index local() const override { return 2 * modes_ + (with_offset_ ? 1 : 0); }
  [[nodiscard]] Index common() const override { return 0; }
  [[nodiscard]] Index derivatives() const override { return 2 * modes_; }
  [[nodiscard]] Index nonlinear() const override { return 2 * modes_; }
  [[nodiscard]] bool local_is_constant() const override { return false; }

  void fill(const VectorXd& theta, std::size_t record, MatrixXd& columns) const override {
    const Index n = samples(record);
    for (Index m = 0; m < modes_; ++m) {
      const Complex s = identification::mode_terms(std::exp(theta[2 * m]), std::exp(theta[2 * m + 1]), 0).pole;
      const Complex advance = std::exp(s * period_s_);
      double re = 1.0, im = 0.0;
      for (Index k = 0; k < n; ++k) {
        const double t = static_cast<double>(k) * period_s_;
        columns(k, 2 * m) = re;
        columns(k, 2 * m + 1) = -im;
        columns(k, local() + 2 * m) = t * re;
        columns(k, local() + 2 * m + 1) = -t * im;
        const double turned = advance.real() * re - advance.imag() * im;
        im = advance.real() * im + advance.imag() * re;
        re = turned;
      }
    }
    if (with_offset_) columns.col(local() - 1).setOnes();
    columns.col(width() - 1) = Eigen::Map<const VectorXd>(responses_[record].data(), n);
  }

  /// d/dp Re(C exp(s t)) = Re(C ds/dp t exp(s t)).
  [[nodiscard]] MatrixXd combine(const VectorXd& theta, const VectorXd& local_values,
                                 const VectorXd& /*common_values*/) const override {
    MatrixXd matrix = MatrixXd::Zero(2 * modes_, 2 * modes_);
    for (Index m = 0; m < modes_; ++m) {
      const auto terms = identification::mode_terms(std::exp(theta[2 * m]), std::exp(theta[2 * m + 1]), 0);
      const Complex amplitude(local_values[2 * m], local_values[2 * m + 1]);
      for (Index p = 0; p < 2; ++p) {
        const Complex weight = amplitude * terms.d_pole[static_cast<std::size_t>(p)];
        matrix(2 * m, 2 * m + p) = weight.real();
        matrix(2 * m + 1, 2 * m + p) = weight.imag();
      }
    }
    return matrix;
  }

  bool clamp(VectorXd& theta) const override { return identification::clamp_logarithms(theta, period_s_); }

 private:
  Responses responses_;
  double period_s_;
  Index modes_;
  bool with_offset_;
};

}  // namespace

DecayFit fit_decay(Responses responses, double period_s, const NaturalModes& start, const DecayFitOptions& options) {
  check_period(period_s);
  identification::check_modes(start, period_s);
  const DecayModel model(responses, period_s, start.omega_rad_s.size(), options.with_offset);
  check_responses(responses, static_cast<std::size_t>(model.width()));
  const std::size_t own = static_cast<std::size_t>(model.local()) * responses.size();
  const std::size_t parameters = own + static_cast<std::size_t>(model.nonlinear());
  std::size_t samples = 0;
  for (const auto response : responses) samples += response.size();
  identification::check_enough(samples, parameters);

  identification::SeparableFit separable =
      identification::fit_separable(model, identification::logarithms(start), options.most_iterations);
  NaturalModes found = identification::from_logarithms(separable.theta);
  DecayFit fit;
  fit.omega_rad_s = std::move(found.omega_rad_s);
  fit.damping_ratio = std::move(found.damping_ratio);
  const auto modes = static_cast<Index>(start.omega_rad_s.size());
  fit.amplitude.resize(static_cast<Index>(responses.size()), modes);
  fit.phase_rad.resize(static_cast<Index>(responses.size()), modes);
  for (std::size_t r = 0; r < responses.size(); ++r) {
    const VectorXd& local = separable.local[r];
    for (Index m = 0; m < modes; ++m) {
      const Complex amplitude(local[2 * m], local[2 * m + 1]);
      fit.amplitude(static_cast<Index>(r), m) = std::abs(amplitude);
      fit.phase_rad(static_cast<Index>(r), m) = std::arg(amplitude);
    }
    fit.offset.push_back(options.with_offset ? local[2 * modes] : 0.0);
  }
  fit.quality = identification::quality_of(separable, parameters);
  const double freedom = static_cast<double>(samples - parameters);
  const MatrixXd logarithmic = options.coloured_residuals
                                   ? identification::coloured_covariance(separable, freedom)
                                   : (separable.sum_of_squares / freedom * separable.inverse_gram).eval();
  VectorXd scale(2 * modes);
  for (Index m = 0; m < modes; ++m) {
    scale[2 * m] = fit.omega_rad_s[static_cast<std::size_t>(m)];
    scale[2 * m + 1] = fit.damping_ratio[static_cast<std::size_t>(m)];
  }
  fit.covariance = scale.asDiagonal() * logarithmic * scale.asDiagonal();
  return fit;
}

}  // namespace shapegcode
