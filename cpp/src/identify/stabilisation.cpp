#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <unsupported/Eigen/FFT>
#include <utility>
#include <vector>

#include "base/linear_algebra.hpp"
#include "identify/fit_common.hpp"
#include "identify/signals.hpp"
#include "shapegcode/identify/arma.hpp"

namespace shapegcode {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index widest = 160;           // rows of the covariance matrix
constexpr double faint_power = 1e-6;    // of the strongest spectral line: below this the spectrum shows nothing
constexpr double decayed = 0.2;         // RMS of the end of a decay over that of all of it
constexpr double force_is_over = 0.02;  // of the force's autocorrelation

std::size_t padded(std::size_t n) {
  std::size_t size = 1;
  while (size < n) size *= 2;
  return size;
}

std::vector<Complex> spectrum(std::span<const double> values, double mean, std::size_t size) {
  std::vector<double> padded_values(size, 0.0);
  std::ranges::transform(values, padded_values.begin(), [mean](double value) { return value - mean; });
  Eigen::FFT<double> fft;
  std::vector<Complex> result;
  fft.fwd(result, padded_values);
  return result;
}

/// The sensor's offset: the mean of the last eighth if the response has decayed by then. Otherwise that mean is
/// meaningless, and the model represents the offset by a real pole.
double offset_of(std::span<const double> values) {
  const Eigen::Map<const VectorXd> all(values.data(), static_cast<Index>(values.size()));
  const auto tail = all.tail(std::max<Index>(all.size() / 8, 1));
  const double offset = tail.mean();
  const double swing = (tail.array() - offset).matrix().norm() / std::sqrt(static_cast<double>(tail.size()));
  const double whole = (all.array() - offset).matrix().norm() / std::sqrt(static_cast<double>(all.size()));
  return swing < decayed * whole ? offset : 0.0;
}

/// Samples per delay such that the highest frequency with content lies below 0.4 of the delays' rate. Looks at blocks
/// of spectral lines, so that a noisy line does not count as content.
Index stride_of(const std::vector<std::vector<double>>& decays) {
  std::size_t longest = 0;
  for (const auto& decay : decays) longest = std::max(longest, decay.size());
  const std::size_t size = padded(longest);
  std::vector<double> power(size / 2 + 1, 0.0);
  for (const auto& decay : decays) {
    const std::vector<Complex> lines = spectrum(decay, 0.0, size);
    for (std::size_t k = 0; k < power.size(); ++k) power[k] += std::norm(lines[k]);
  }
  std::vector<double> sorted = power;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  const double strongest = *std::ranges::max_element(power);
  const double content = std::max(faint_power * strongest, 20.0 * *middle);
  std::size_t highest = power.size() - 1;
  while (highest > 0 && power[highest] < content) --highest;
  const double cycles = static_cast<double>(std::max<std::size_t>(highest, 1)) / static_cast<double>(size);
  return std::max<Index>(static_cast<Index>(0.4 / cycles), 1);
}

/// Sum over all decays of h h', h the values at `width` delays of `stride` samples. Each diagonal follows from its
/// first entry by what enters and leaves at its ends.
MatrixXd covariance_of(const std::vector<std::vector<double>>& decays, Index width, Index stride) {
  MatrixXd sum = MatrixXd::Zero(width, width);
  for (const auto& decay : decays) {
    const Eigen::Map<const VectorXd> g(decay.data(), static_cast<Index>(decay.size()));
    const Index rows = g.size() - (width - 1) * stride;
    if (rows <= 0) continue;
    for (Index lag = 0; lag < width; ++lag) {
      double entry = g.head(rows).dot(g.segment(lag * stride, rows));
      for (Index j = 0; j + lag < width; ++j) {
        sum(j, j + lag) += entry;
        const Index from = j * stride;
        const Index other = (j + lag) * stride;
        if (j + lag + 1 == width) break;
        entry += g.segment(from + rows, stride).dot(g.segment(other + rows, stride)) -
                 g.segment(from, stride).dot(g.segment(other, stride));
      }
    }
  }
  return sum.selfadjointView<Eigen::Upper>();
}

std::vector<std::vector<Complex>> poles_of(const std::vector<std::vector<double>>& decays, int n_max) {
  std::size_t longest = 0;
  for (const auto& decay : decays) longest = std::max(longest, decay.size());
  const auto length = static_cast<Index>(longest);
  const Index most = 2 * static_cast<Index>(n_max);
  // At most a half of the samples are delays: the rest is what is averaged over.
  const Index width = std::min(widest, std::max(most + 2, length / 2));
  const Index stride = std::min(stride_of(decays), std::max<Index>(length / 2 / width, 1));
  // Ascending: the signal's directions are the last ones.
  const MatrixXd directions = linear_algebra::symmetric_eigen(covariance_of(decays, width, stride)).vectors;
  const MatrixXd signal = directions.rightCols(most).rowwise().reverse();
  const MatrixXd product = signal.topRows(width - 1).transpose() * signal.bottomRows(width - 1);
  std::vector<std::vector<Complex>> poles;
  for (Index n = 2; n <= most; n += 2) {
    // (U1'U1)^-1 U1'U2 with U1 all rows but the last and U'U = 1.
    const VectorXd last = signal.row(width - 1).head(n).transpose();
    const MatrixXd corner = product.topLeftCorner(n, n);
    const double remaining = std::max(1.0 - last.squaredNorm(), 1e-12);
    const MatrixXd shift = corner + last * (last.transpose() * corner) / remaining;
    std::vector<Complex> found;
    for (const Complex& value : linear_algebra::eigenvalues(shift)) {
      found.push_back(stride == 1 ? value : std::pow(value, 1.0 / static_cast<double>(stride)));
    }
    poles.push_back(std::move(found));
  }
  return poles;
}

std::size_t min_samples(int n_max) {
  identification::check_mode_count(n_max);
  return 8 * static_cast<std::size_t>(n_max) + 8;
}

}  // namespace

std::vector<std::vector<Complex>> stabilisation_poles(std::span<const TapSignals> taps, int n_max) {
  const std::size_t least = min_samples(n_max);
  check_taps(taps, least);
  std::size_t longest = 0;
  for (const TapSignals& tap : taps) longest = std::max(longest, tap.response.size());
  const std::size_t size = padded(2 * longest);
  std::vector<Complex> cross(size, 0.0);
  std::vector<Complex> own(size, 0.0);
  for (const TapSignals& tap : taps) {
    const std::vector<Complex> force = spectrum(tap.force_n, 0.0, size);
    const std::vector<Complex> response = spectrum(tap.response, offset_of(tap.response), size);
    for (std::size_t k = 0; k < size; ++k) {
      cross[k] += std::conj(force[k]) * response[k];
      own[k] += std::norm(force[k]);
    }
  }
  Eigen::FFT<double> fft;
  std::vector<double> correlation;
  std::vector<double> force_correlation;
  fft.inv(correlation, cross);
  fft.inv(force_correlation, own);
  // From the lag on at which the force has nothing to do with itself any more, the correlation decays freely.
  std::size_t first = longest / 4;
  while (first > 1 && std::abs(force_correlation[first - 1]) < force_is_over * force_correlation[0]) --first;
  first = std::min(first, longest - std::min(longest, least));
  return poles_of({{correlation.begin() + static_cast<std::ptrdiff_t>(first),
                    correlation.begin() + static_cast<std::ptrdiff_t>(longest)}},
                  n_max);
}

std::vector<std::vector<Complex>> stabilisation_poles(Responses responses, int n_max) {
  check_responses(responses, min_samples(n_max));
  std::vector<std::vector<double>> decays;
  for (const auto response : responses) {
    std::vector<double> decay(response.begin(), response.end());
    const double offset = offset_of(response);
    for (double& value : decay) value -= offset;
    decays.push_back(std::move(decay));
  }
  return poles_of(decays, n_max);
}

}  // namespace shapegcode
