#include "shapegcode/identify/arma.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "base/linear_algebra.hpp"
#include "identify/fit_common.hpp"
#include "identify/separable_fit.hpp"
#include "identify/signals.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int most_least_squares = 40;
// Relative changes of phi and of the residual sum of squares below which the iteration has converged. The coefficients
// of close poles are poorly determined, so the residual converges before phi.
constexpr double settled_phi = 1e-11;
constexpr double settled_squares = 1e-9;
constexpr double exact_arma_share = 1e-20;  // of the responses' squares

struct InputOutput {
  VectorXd input;
  VectorXd output;
};

/// x/A.
VectorXd through_denominator(const VectorXd& x, const VectorXd& phi) {
  VectorXd y(x.size());
  for (Index k = 0; k < x.size(); ++k) {
    double sum = x[k];
    for (Index i = 0; i < std::min(k, phi.size()); ++i) sum += phi[i] * y[k - 1 - i];
    y[k] = sum;
  }
  return y;
}

/// Column j of `columns` becomes x delayed by first_delay + j samples.
void fill_delayed(const VectorXd& x, Index first_delay, Eigen::Ref<MatrixXd> columns) {
  for (Index j = 0; j < columns.cols(); ++j) {
    const Index delay = std::min(first_delay + j, x.size());
    columns.col(j).head(delay).setZero();
    columns.col(j).tail(x.size() - delay) = x.head(x.size() - delay);
  }
}

std::vector<Complex> roots(const VectorXd& phi) {
  const Index n = phi.size();
  MatrixXd companion = MatrixXd::Zero(n, n);
  companion.row(0) = phi.transpose();
  companion.diagonal(-1).setOnes();
  const Eigen::VectorXcd values = linear_algebra::eigenvalues(companion);
  return {values.begin(), values.end()};
}

VectorXd phi_of(const std::vector<Complex>& poles) {
  std::vector<Complex> polynomial{1.0};
  for (const Complex& pole : poles) {
    polynomial.emplace_back(0.0);
    for (std::size_t k = polynomial.size() - 1; k > 0; --k) polynomial[k] -= pole * polynomial[k - 1];
  }
  VectorXd phi(static_cast<Index>(poles.size()));
  for (std::size_t k = 1; k < polynomial.size(); ++k) phi[static_cast<Index>(k) - 1] = -polynomial[k].real();
  return phi;
}

/// Reflects poles outside the unit circle into it.
VectorXd stable(const VectorXd& phi) {
  std::vector<Complex> poles = roots(phi);
  bool changed = false;
  for (Complex& pole : poles) {
    if (std::abs(pole) <= 1.0 + 1e-12) continue;
    pole = 1.0 / std::conj(pole);
    changed = true;
  }
  return changed ? phi_of(poles) : phi;
}

/// Sum over records of the mean squared residual; infinite without a model.
double total_squares(const Arma& arma) {
  return arma.residual_rms.empty()
             ? std::numeric_limits<double>::infinity()
             : Eigen::Map<const VectorXd>(arma.residual_rms.data(), static_cast<Index>(arma.residual_rms.size()))
                   .squaredNorm();
}

class IteratedLeastSquares {
 public:
  /// `shared`: one numerator of `terms` terms for all records, otherwise one for each.
  IteratedLeastSquares(std::vector<InputOutput> records, Index order, Index terms, bool shared)
      : records_(std::move(records)), order_(order), terms_(terms), shared_(shared) {}

  Arma from(VectorXd phi, int rounds) const {
    Arma best;
    double best_squares = std::numeric_limits<double>::infinity();
    double last_squares = best_squares;
    double response_squares = 0.0;  // per sample, as the residual's
    for (const InputOutput& record : records_) {
      response_squares += record.output.squaredNorm() / static_cast<double>(record.output.size());
    }
    if (phi.size() > 0) {
      best = with_numerators(phi);
      best_squares = total_squares(best);
    }
    for (int round = 1; round <= rounds; ++round) {
      const VectorXd next = stable(denominator(phi));
      if (!next.allFinite()) break;
      const double change = phi.size() == next.size() ? (next - phi).cwiseAbs().maxCoeff() : 1.0;
      phi = next;
      Arma tried = with_numerators(phi);
      const double squares = total_squares(tried);
      const bool has_settled = change <= settled_phi * phi.cwiseAbs().maxCoeff() ||
                               std::abs(squares - last_squares) <= settled_squares * squares ||
                               squares <= exact_arma_share * response_squares;
      last_squares = squares;
      if (squares < best_squares) {
        best_squares = squares;
        best = std::move(tried);
      }
      best.iterations = round;
      best.converged = has_settled;
      if (has_settled) break;
    }
    return best;
  }

 private:
  /// Least squares of phi and numerators with signals filtered by 1/A of `phi` (empty: unfiltered).
  VectorXd denominator(const VectorXd& phi) const {
    const Index kept = order_ + 1 + (shared_ ? terms_ : 0);
    const Index eliminated = shared_ ? 0 : terms_;
    const Index width = order_ + terms_ + 1;
    MatrixXd stack(static_cast<Index>(records_.size()) * kept, kept);
    for (std::size_t r = 0; r < records_.size(); ++r) {
      const VectorXd input = through_denominator(records_[r].input, phi);
      const VectorXd output = through_denominator(records_[r].output, phi);
      MatrixXd columns(output.size(), width);
      fill_delayed(input, 0, columns.leftCols(terms_));
      fill_delayed(output, 1, columns.middleCols(terms_, order_));
      columns.rightCols(1) = output;
      linear_algebra::triangulate(columns);
      stack.middleRows(static_cast<Index>(r) * kept, kept) = columns.block(eliminated, eliminated, kept, kept);
    }
    // A model with more modes than the data have does not determine all coefficients: take the smallest ones.
    const Index unknowns = kept - 1;
    return linear_algebra::least_norm_solution(stack.leftCols(unknowns), stack.col(unknowns)).tail(order_);
  }

  Arma with_numerators(const VectorXd& phi) const {
    Arma arma;
    arma.phi = phi;
    std::vector<MatrixXd> inputs;
    for (const InputOutput& record : records_) {
      MatrixXd columns(record.input.size(), terms_);
      fill_delayed(through_denominator(record.input, phi), 0, columns);
      inputs.push_back(std::move(columns));
    }
    arma.numerator.resize(shared_ ? 1 : static_cast<Index>(records_.size()), terms_);
    if (shared_) {
      MatrixXd stack(static_cast<Index>(records_.size()) * (terms_ + 1), terms_ + 1);
      for (std::size_t r = 0; r < records_.size(); ++r) {
        MatrixXd columns(inputs[r].rows(), terms_ + 1);
        columns << inputs[r], records_[r].output;
        linear_algebra::triangulate(columns);
        stack.middleRows(static_cast<Index>(r) * (terms_ + 1), terms_ + 1) = columns.topRows(terms_ + 1);
      }
      arma.numerator.row(0) =
          linear_algebra::least_norm_solution(stack.leftCols(terms_), stack.col(terms_)).transpose();
    }
    for (std::size_t r = 0; r < records_.size(); ++r) {
      const Index row = shared_ ? 0 : static_cast<Index>(r);
      if (!shared_) {
        arma.numerator.row(row) = linear_algebra::least_squares(inputs[r], records_[r].output).transpose();
      }
      const VectorXd residual = records_[r].output - inputs[r] * arma.numerator.row(row).transpose();
      arma.residual_rms.push_back(std::sqrt(residual.squaredNorm() / static_cast<double>(residual.size())));
    }
    return arma;
  }

  std::vector<InputOutput> records_;
  Index order_;
  Index terms_;
  bool shared_;
};

VectorXd column_of(std::span<const double> values) {
  return Eigen::Map<const VectorXd>(values.data(), static_cast<Index>(values.size()));
}

/// One unfiltered round.
Arma plain_least_squares(const IteratedLeastSquares& problem) {
  Arma arma = problem.from({}, 1);
  arma.converged = true;
  return arma;
}

/// Starts from the subspace method's poles, and from the plain least squares if that does not settle.
Arma iterated(const IteratedLeastSquares& problem, const std::vector<Complex>& poles) {
  Arma arma = problem.from(stable(phi_of(poles)), most_least_squares);
  if (!arma.converged) {
    Arma other = problem.from({}, most_least_squares);
    if (total_squares(other) < total_squares(arma)) arma = std::move(other);
  }
  return arma;
}

/// What follows from phi and numerator.
Arma complete(Arma arma) {
  if (arma.phi.size() == 0) {
    throw Error(ErrorKind::numeric, "the least squares of an ARMA model gave no finite coefficients");
  }
  arma.poles = roots(arma.phi);
  arma.theta = -arma.numerator.rightCols(arma.numerator.cols() - 1);
  for (Index r = 0; r < arma.theta.rows(); ++r) {
    const double first = arma.numerator(r, 0);
    arma.theta.row(r) /= first == 0.0 ? std::numeric_limits<double>::quiet_NaN() : first;
  }
  return arma;
}

}  // namespace

Arma arma_driven(std::span<const TapSignals> taps, int n_modes, bool plain) {
  identification::check_mode_count(n_modes);
  const Index order = 2 * static_cast<Index>(n_modes);
  check_taps(taps, static_cast<std::size_t>(std::max<Index>(2 * order + 2, 4 * order + 8)));
  std::vector<InputOutput> records;
  for (const TapSignals& tap : taps) records.push_back({column_of(tap.force_n), column_of(tap.response)});
  const IteratedLeastSquares problem(std::move(records), order, order + 1, true);
  return complete(plain ? plain_least_squares(problem) : iterated(problem, stabilisation_poles(taps, n_modes).back()));
}

Arma arma_decay(Responses responses, int n_modes, bool plain) {
  identification::check_mode_count(n_modes);
  const Index order = 2 * static_cast<Index>(n_modes);
  check_responses(responses, static_cast<std::size_t>(4 * order + 8));
  std::vector<InputOutput> records;
  for (const auto response : responses) {
    VectorXd impulse = VectorXd::Zero(static_cast<Index>(response.size()));
    impulse[0] = 1.0;
    records.push_back({std::move(impulse), column_of(response)});
  }
  const IteratedLeastSquares problem(std::move(records), order, order, false);
  return complete(plain ? plain_least_squares(problem)
                        : iterated(problem, stabilisation_poles(responses, n_modes).back()));
}

NaturalModes poles_to_modes(std::span<const Complex> poles, double period_s) {
  check_period(period_s);
  std::vector<std::pair<double, double>> found;
  for (const Complex& pole : poles) {
    // One of each pair. A pole on the real axis but for rounding is none.
    if (!(pole.imag() > 1e-12 * std::abs(pole)) || !(std::abs(pole) < 1.0)) continue;
    const Complex logarithm = std::log(pole);
    found.emplace_back(std::abs(logarithm) / period_s, -logarithm.real() / std::abs(logarithm));
  }
  std::ranges::sort(found);
  NaturalModes modes;
  for (const auto& [omega, zeta] : found) {
    modes.omega_rad_s.push_back(omega);
    modes.damping_ratio.push_back(zeta);
  }
  return modes;
}

}  // namespace shapegcode
