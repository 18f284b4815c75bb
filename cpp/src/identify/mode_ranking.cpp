#include "shapegcode/identify/modal_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "base/linear_algebra.hpp"
#include "base/refuse.hpp"
#include "identify/fit_common.hpp"
#include "identify/one_pole.hpp"
#include "identify/signals.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// If less than this fraction of a candidate's response cannot be explained by the chosen ones, it is one of them.
constexpr double least_own_share = 1e-6;

/// Products of the candidates' columns (unit length, offset taken out) and of these with the response, from which the
/// chosen ones are taken out one by one (Gram-Schmidt on the products).
struct Products {
  MatrixXd gram;
  VectorXd with_response;
};

void remove_offset(MatrixXd& columns) { columns.rowwise() -= columns.colwise().mean().eval(); }

Products products_of(MatrixXd columns, const VectorXd& response) {
  for (Index j = 0; j < columns.cols(); ++j) {
    const double length = columns.col(j).norm();
    if (length > 0.0) columns.col(j) /= length;
  }
  return {columns.transpose() * columns, columns.transpose() * response};
}

/// What candidate `c` (columns c*group ...) takes off the squares; 0 if it is a combination of those taken out.
double gain_of(const Products& products, Index c, Index group) {
  const MatrixXd own = products.gram.block(c * group, c * group, group, group);
  const auto [sizes, directions] = linear_algebra::symmetric_eigen(own);
  const VectorXd parts = directions.transpose() * products.with_response.segment(c * group, group);
  double gain = 0.0;
  for (Index i = 0; i < group; ++i) {
    const double size = sizes[i];
    if (size > least_own_share) gain += parts[i] * parts[i] / size;
  }
  return gain;
}

void take_out(Products& products, Index column) {
  const double size = products.gram(column, column);
  if (!(size > least_own_share)) return;
  const VectorXd share = products.gram.col(column) / size;
  const double with_response = products.with_response[column];
  products.gram -= (share * share.transpose() * size).eval();
  products.with_response -= share * with_response;
}

ModeRanking rank(std::vector<Products> problems, double total, Index candidates, Index group, std::size_t most,
                 std::size_t kept) {
  ModeRanking ranking;
  ranking.total = total;
  std::vector<bool> taken(static_cast<std::size_t>(candidates), false);
  double left = total;
  while (ranking.chosen.size() < std::min(most, taken.size())) {
    const bool given = ranking.chosen.size() < kept;
    const auto next = static_cast<Index>(ranking.chosen.size());
    Index best = given ? next : -1;
    double best_gain = 0.0;
    for (Index c = given ? next : 0; c < (given ? next + 1 : candidates); ++c) {
      if (taken[static_cast<std::size_t>(c)]) continue;
      double gain = 0.0;
      for (const Products& products : problems) gain += gain_of(products, c, group);
      if (gain > best_gain) {
        best = c;
        best_gain = gain;
      }
    }
    if (best < 0) break;
    taken[static_cast<std::size_t>(best)] = true;
    for (Products& products : problems) {
      for (Index i = 0; i < group; ++i) take_out(products, best * group + i);
    }
    left = std::max(left - best_gain, 0.0);
    ranking.chosen.push_back(static_cast<std::size_t>(best));
    ranking.sum_of_squares.push_back(left);
  }
  return ranking;
}

void check_numbers(std::size_t most, std::size_t kept, std::size_t candidates) {
  if (most < 1) refuse("no mode to be chosen, at least 1 needed");
  if (kept > candidates) {
    refuse("{} candidates to be kept of {}", kept, candidates);
  }
}

/// The response with its mean taken out.
VectorXd centred(std::span<const double> response) {
  VectorXd values = Eigen::Map<const VectorXd>(response.data(), static_cast<Index>(response.size()));
  values.array() -= values.mean();
  return values;
}

}  // namespace

ModeRanking rank_modes(std::span<const TapSignals> taps, double period_s, const NaturalModes& candidates,
                       std::size_t most, std::size_t kept, Quantity quantity) {
  check_period(period_s);
  identification::check_modes(candidates, period_s);
  check_taps(taps, 2);
  check_numbers(most, kept, candidates.omega_rad_s.size());
  const auto count = static_cast<Index>(candidates.omega_rad_s.size());
  Index samples = 0;
  for (const TapSignals& tap : taps) samples += static_cast<Index>(tap.response.size());
  MatrixXd all(samples, count);
  VectorXd responses(samples);
  Index first = 0;
  const double unit[] = {1.0};
  for (const TapSignals& tap : taps) {
    const auto n = static_cast<Index>(tap.response.size());
    MatrixXd columns(n, count);
    for (Index c = 0; c < count; ++c) {
      const auto m = static_cast<std::size_t>(c);
      columns.col(c) = modal_response(tap.force_n, period_s,
                                      {{candidates.omega_rad_s[m]}, {candidates.damping_ratio[m]}}, unit, quantity);
    }
    remove_offset(columns);
    all.middleRows(first, n) = columns;
    responses.segment(first, n) = centred(tap.response);
    first += n;
  }
  const double total = responses.squaredNorm();
  std::vector<Products> problems;
  problems.push_back(products_of(std::move(all), responses));
  return rank(std::move(problems), total, count, 1, most, kept);
}

ModeRanking rank_modes(Responses responses, double period_s, const NaturalModes& candidates, std::size_t most,
                       std::size_t kept) {
  check_period(period_s);
  identification::check_modes(candidates, period_s);
  check_responses(responses, 2);
  check_numbers(most, kept, candidates.omega_rad_s.size());
  const auto count = static_cast<Index>(candidates.omega_rad_s.size());
  std::vector<Products> problems;
  double total = 0.0;
  for (const auto record : responses) {
    const auto n = static_cast<Index>(record.size());
    MatrixXd columns(n, 2 * count);
    for (Index c = 0; c < count; ++c) {
      const auto m = static_cast<std::size_t>(c);
      const auto pole = identification::mode_terms(candidates.omega_rad_s[m], candidates.damping_ratio[m], 0).pole;
      for (Index k = 0; k < n; ++k) {
        const std::complex<double> value = std::exp(pole * (static_cast<double>(k) * period_s));
        columns(k, 2 * c) = value.real();
        columns(k, 2 * c + 1) = value.imag();
      }
    }
    remove_offset(columns);
    const VectorXd response = centred(record);
    total += response.squaredNorm();
    problems.push_back(products_of(std::move(columns), response));
  }
  return rank(std::move(problems), total, count, 2, most, kept);
}

}  // namespace shapegcode
