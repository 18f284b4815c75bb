#include <doctest/doctest.h>

#include <cmath>
#include <span>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/identify/modal_fit.hpp"

using shapegcode::ModeRanking;
using shapegcode::NaturalModes;

namespace {

constexpr double period_s = 5e-4;
const NaturalModes candidates{{500.0, 300.0, 2000.0, 900.0}, {0.02, 0.05, 0.01, 0.02}};

}  // namespace

TEST_CASE("mode ranking: what a response is made of comes first, the strongest ahead") {
  std::vector<double> force(800, 0.0);
  force[3] = 100.0;
  const std::vector<double> residues{0.0, 0.05, 0.0, 0.3};
  const auto response =
      shapegcode::modal_response(force, period_s, candidates, residues, shapegcode::Quantity::acceleration);
  const std::vector<double> values(response.begin(), response.end());
  const std::vector<shapegcode::TapSignals> taps{{force, values}};
  const ModeRanking ranking = shapegcode::rank_modes(taps, period_s, candidates, 2);
  CHECK(ranking.chosen == std::vector<std::size_t>{3, 1});
  CHECK(ranking.sum_of_squares[1] < 1e-9 * ranking.total);
  const ModeRanking with_kept = shapegcode::rank_modes(taps, period_s, candidates, 3, 1);
  REQUIRE(with_kept.chosen.size() >= 3);
  CHECK(with_kept.chosen[0] == 0);
  CHECK(with_kept.chosen[1] == 3);
  CHECK_THROWS_AS((void)shapegcode::rank_modes(taps, period_s, candidates, 0), shapegcode::Error);
  CHECK_THROWS_AS((void)shapegcode::rank_modes(taps, period_s, candidates, 2, 5), shapegcode::Error);
}

TEST_CASE("mode ranking: decays, each record with its own phase") {
  std::vector<double> first;
  std::vector<double> second;
  for (int k = 0; k < 800; ++k) {
    const double t = k * period_s;
    const auto part = [t](std::size_t m, double phase) {
      const double omega = candidates.omega_rad_s[m];
      const double zeta = candidates.damping_ratio[m];
      return std::exp(-zeta * omega * t) * std::cos(omega * std::sqrt(1.0 - zeta * zeta) * t + phase);
    };
    first.push_back(0.3 * part(0, 1.0) + 2.0 * part(2, 0.3));
    second.push_back(0.2 * part(0, -0.4) - 1.0 * part(2, 2.0));
  }
  const std::vector<std::span<const double>> records{first, second};
  const ModeRanking ranking = shapegcode::rank_modes(records, period_s, candidates, 2);
  CHECK(ranking.chosen == std::vector<std::size_t>{2, 0});
  CHECK(ranking.sum_of_squares[1] < 1e-9 * ranking.total);
}
