#include "shapegcode/measure/sections.hpp"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

#include "base/linear_algebra.hpp"
#include "base/refuse.hpp"
#include "measure/profile.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

constexpr double min_circle_rad = std::numbers::pi / 10.0;
constexpr double min_stations_per_cutoff = 5.0;
constexpr double sampling_lengths = 5.0;
constexpr double rounding_share = 1e-9;  // of a length that is a whole number of spacings but for rounding

std::vector<double> less_fit(std::span<const double> profile, const Eigen::MatrixXd& basis) {
  const Eigen::Map<const Eigen::VectorXd> values(profile.data(), static_cast<Eigen::Index>(profile.size()));
  const Eigen::VectorXd rest = values - basis * linear_algebra::least_squares(basis, values);
  return {rest.begin(), rest.end()};
}

/// Number of spacings that fit into a length; at most `most`.
std::size_t whole_spacings(double length_mm, double spacing_mm, std::size_t most) {
  const double count = std::floor(length_mm / spacing_mm * (1.0 + rounding_share));
  return count < static_cast<double>(most) ? static_cast<std::size_t>(count) : most;
}

double mean_magnitude(std::span<const double> values, double reference) {
  double sum = 0.0;
  for (const double value : values) sum += std::abs(value - reference);
  return sum / static_cast<double>(values.size());
}

double mean(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace

std::vector<double> gaussian_low_pass(std::span<const double> profile_mm, double spacing_mm, double cutoff_mm) {
  if (!(spacing_mm > 0.0 && cutoff_mm > 0.0 && std::isfinite(cutoff_mm))) {
    refuse("spacing {} mm and cut-off {} mm must be > 0", spacing_mm, cutoff_mm);
  }
  const auto bad = std::ranges::find_if(profile_mm, [](double value) { return !std::isfinite(value); });
  if (bad != profile_mm.end()) refuse("the profile is not finite at station {}", bad - profile_mm.begin());
  const double alpha = std::sqrt(std::numbers::ln2 / std::numbers::pi);
  // Weights further away than the profile is long are never asked for.
  std::vector<double> weights(whole_spacings(cutoff_mm, spacing_mm, profile_mm.size()) + 1);
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double x = static_cast<double>(i) * spacing_mm / (alpha * cutoff_mm);
    weights[i] = std::exp(-std::numbers::pi * x * x);
  }
  const std::size_t n = profile_mm.size();
  std::vector<double> smooth(n);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t first = i + 1 > weights.size() ? i + 1 - weights.size() : 0;
    const std::size_t last = std::min(n - 1, i + weights.size() - 1);
    double sum = 0.0;
    double total = 0.0;
    for (std::size_t k = first; k <= last; ++k) {
      const double weight = weights[k > i ? k - i : i - k];
      sum += weight * profile_mm[k];
      total += weight;
    }
    smooth[i] = sum / total;
  }
  return smooth;
}

std::optional<double> standard_cutoff_mm(double length_mm, double spacing_mm) noexcept {
  for (const double cutoff : {0.8, 0.25, 0.08}) {
    const bool fits = (sampling_lengths + 2.0) * cutoff <= length_mm * (1.0 + rounding_share);
    if (fits && cutoff >= min_stations_per_cutoff * spacing_mm * (1.0 - rounding_share)) return cutoff;
  }
  return std::nullopt;
}

Roughness measure_roughness(std::span<const double> profile_mm, double spacing_mm, double cutoff_mm,
                            double lambda_s_mm) {
  std::vector<double> primary(profile_mm.begin(), profile_mm.end());
  if (lambda_s_mm > 0.0) primary = gaussian_low_pass(primary, spacing_mm, lambda_s_mm);
  const std::vector<double> waviness = gaussian_low_pass(primary, spacing_mm, cutoff_mm);
  const std::size_t cut = whole_spacings(cutoff_mm, spacing_mm, primary.size());
  const std::size_t per_length = std::max<std::size_t>(1, cut);
  if (primary.size() < 2 * cut + per_length) {
    refuse("a profile of {} stations of {} mm is too short for a cut-off of {} mm: three cut-offs are needed",
           primary.size(), spacing_mm, cutoff_mm);
  }
  const std::span<const double> kept(waviness.begin() + static_cast<std::ptrdiff_t>(cut), primary.size() - 2 * cut);
  std::vector<double> roughness(kept.size());
  for (std::size_t i = 0; i < kept.size(); ++i) roughness[i] = primary[i + cut] - kept[i];

  Roughness figures;
  figures.cutoff_mm = cutoff_mm;
  figures.evaluated_mm = static_cast<double>(kept.size()) * spacing_mm;
  figures.ra_mm = mean_magnitude(roughness, 0.0);
  figures.wa_mm = mean_magnitude(kept, mean(kept));
  const std::size_t lengths = roughness.size() / per_length;
  for (std::size_t i = 0; i < lengths; ++i) {
    const auto begin = roughness.begin() + static_cast<std::ptrdiff_t>(i * per_length);
    const auto [least, largest] = std::minmax_element(begin, begin + static_cast<std::ptrdiff_t>(per_length));
    figures.rz_mm += (*largest - *least) / static_cast<double>(lengths);
  }
  return figures;
}

std::vector<double> without_line(std::span<const double> profile_mm) {
  if (profile_mm.empty()) return {};
  const auto n = static_cast<Eigen::Index>(profile_mm.size());
  Eigen::MatrixXd basis(n, 2);
  basis.col(0).setOnes();
  basis.col(1).setLinSpaced(-1.0, 1.0);
  return less_fit(profile_mm, basis);
}

std::vector<double> without_circle(std::span<const double> profile_mm, double step_rad) {
  const auto n = static_cast<Eigen::Index>(profile_mm.size());
  if (static_cast<double>(n) * std::abs(step_rad) < min_circle_rad) return without_line(profile_mm);
  Eigen::MatrixXd basis(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const double angle = (static_cast<double>(i) - 0.5 * static_cast<double>(n - 1)) * step_rad;
    basis.row(i) << 1.0, std::cos(angle), std::sin(angle);
  }
  return less_fit(profile_mm, basis);
}

}  // namespace shapegcode
