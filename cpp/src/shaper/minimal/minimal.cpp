#include "shapegcode/minimal_shapers.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "shapegcode/error.hpp"

#include "base/linear_algebra.hpp"
#include "shaper/minimal/search_limits.hpp"

// How the amplitudes are eliminated. With p(t) = e^{-s t} = e^{alpha t} e^{-j beta t} one mode asks for
// A1 + A2 p(t2) + A3 p(t3) = 0: two real rows. A vector orthogonal to both is their cross product,
//     v = (sin beta(t3-t2), -e^{-alpha t2} sin beta t3, e^{-alpha t3} sin beta t2)      (scaled: every part is <= 1)
// so both modes can be served if v1 and v2 are parallel: G(t2, t3) = v1 x v2 = 0, and A = v/sum(v).
// |G| and its derivatives are bounded by the poles alone, which is what lets whole boxes be discarded.

namespace shapegcode {

namespace {

using minimal::duration_slack;
using minimal::most_periods;
using minimal::same_pole;

constexpr double first_box = 1.0 / 16.0;    // half width of the first boxes in periods of the faster mode
constexpr int halvings = 5;                 // of a box that cannot be discarded
constexpr double same_solution = 1e-5;      // periods of the faster mode between two solutions
constexpr double small_tap = 1e-4;          // amplitude below which the shaper is tried without the tap
constexpr double largest_residual = 1e-13;  // of an accepted solution
constexpr int newton_steps = 40;
constexpr double small_pivot = 1e-9;  // of the largest: the equations are dependent

using Vector2 = Eigen::Vector2d;
using Vec3 = Eigen::Vector3d;

/// v of the note above, and its derivatives with respect to t2 and t3.
struct NullVector {
  Vec3 value;
  Vec3 by_t2;
  Vec3 by_t3;
};

NullVector null_vector(const std::complex<double>& s, double t2, double t3) {
  const double alpha = -s.real();
  const double beta = s.imag();
  const double decay2 = std::exp(-alpha * t2);
  const double decay3 = std::exp(-alpha * t3);
  const double sin2 = std::sin(beta * t2);
  const double cos2 = std::cos(beta * t2);
  const double sin3 = std::sin(beta * t3);
  const double cos3 = std::cos(beta * t3);
  const double sin32 = sin3 * cos2 - cos3 * sin2;
  const double cos32 = cos3 * cos2 + sin3 * sin2;
  return {Vec3(sin32, -decay2 * sin3, decay3 * sin2), Vec3(-beta * cos32, alpha * decay2 * sin3, beta * decay3 * cos2),
          Vec3(beta * cos32, -beta * decay2 * cos3, -alpha * decay3 * sin2)};
}

class TwoModeSearch {
 public:
  TwoModeSearch(const std::complex<double>& s1, const std::complex<double>& s2, double max_duration_s,
                double max_abs_sum)
      : poles_{s1, s2},
        omega_(std::max(std::abs(s1), std::abs(s2))),
        max_duration_s_(max_duration_s * (1.0 + duration_slack)),
        max_abs_sum_(max_abs_sum) {}

  [[nodiscard]] std::vector<Shaper> run() {
    add_commensurate_starts();
    scan();
    for (const Vector2& start : distinct_starts()) {
      if (auto shaper = polish(start)) {
        keep(std::move(*shaper));
      }
    }
    std::ranges::sort(solutions_, [this](const Shaper& a, const Shaper& b) { return before(a, b); });
    return std::move(solutions_);
  }

 private:
  [[nodiscard]] double period() const { return 2.0 * std::numbers::pi / omega_; }

  /// Undamped modes look alike (up to the sign of the phase) at multiples of 1/(f1+f2) and of 1/(f2-f1), so any three
  /// such times serve both: exact solutions without damping, good starts with it. The uniform ones are (t, 2t).
  void add_commensurate_starts() {
    const double f1 = poles_[0].imag() / (2.0 * std::numbers::pi);
    const double f2 = poles_[1].imag() / (2.0 * std::numbers::pi);
    for (const double rate : {f1 + f2, std::abs(f2 - f1)}) {
      const int last = static_cast<int>(std::ceil(max_duration_s_ * rate));
      for (int k3 = 2; k3 <= last; ++k3) {
        for (int k2 = 1; k2 < k3; ++k2) {
          starts_.emplace_back(k2 / rate, k3 / rate);
        }
      }
    }
  }

  void scan() {
    const double half = first_box * period();
    const int count = static_cast<int>(std::ceil(max_duration_s_ / (2.0 * half)));
    for (int i3 = 0; i3 < count; ++i3) {
      for (int i2 = 0; i2 <= i3; ++i2) {
        search_box((2.0 * i2 + 1.0) * half, (2.0 * i3 + 1.0) * half, half, halvings);
      }
    }
  }

  void search_box(double t2, double t3, double half, int levels) {
    if (t2 - half >= t3 + half || t3 - half > max_duration_s_ || holds_none(t2, t3, half)) {
      return;
    }
    if (levels == 0) {
      if (const auto root = parallel_root(t2, t3)) {
        starts_.push_back(*root);
      }
      return;
    }
    const double quarter = 0.5 * half;
    for (const double d2 : {-quarter, quarter}) {
      for (const double d3 : {-quarter, quarter}) {
        search_box(t2 + d2, t3 + d3, quarter, levels - 1);
      }
    }
  }

  /// True if no (t2, t3) within `half` of the centre can be a solution within the bounds.
  [[nodiscard]] bool holds_none(double t2, double t3, double half) const {
    const std::array<NullVector, 2> v{null_vector(poles_[0], t2, t3), null_vector(poles_[1], t2, t3)};
    // Amplitudes are v/sum(v): too large throughout the box? Each part of v moves by at most 2*omega*half, the sum's
    // by its gradient and a second-order rest.
    for (std::size_t i = 0; i < 2; ++i) {
      const double reach = 2.0 * std::abs(poles_[i]) * half;
      const double min_abs_sum = v[i].value.cwiseAbs().sum() - 3.0 * reach;
      const double largest_sum = std::abs(v[i].value.sum()) +
                                 half * (std::abs(v[i].by_t2.sum()) + std::abs(v[i].by_t3.sum())) + 1.5 * reach * reach;
      if (min_abs_sum > max_abs_sum_ * largest_sum) {
        return true;
      }
    }
    const Vec3 g = v[0].value.cross(v[1].value);
    const Vec3 g2 = v[0].by_t2.cross(v[1].value) + v[0].value.cross(v[1].by_t2);
    const Vec3 g3 = v[0].by_t3.cross(v[1].value) + v[0].value.cross(v[1].by_t3);
    const double both = std::abs(poles_[0]) + std::abs(poles_[1]);
    const double rest = 4.0 * both * both * half * half;
    return ((g.cwiseAbs() - half * (g2.cwiseAbs() + g3.cwiseAbs())).array() > rest).any();
  }

  /// Gauss-Newton on G = 0 from (t2, t3). Also finds points that are no shapers (coinciding times, one of the v zero):
  /// `polish` sorts them out.
  [[nodiscard]] std::optional<Vector2> parallel_root(double t2, double t3) const {
    Vector2 t(t2, t3);
    const double far = 0.5 * period();
    for (int step = 0; step < newton_steps; ++step) {
      const NullVector a = null_vector(poles_[0], t.x(), t.y());
      const NullVector b = null_vector(poles_[1], t.x(), t.y());
      Eigen::Matrix<double, 3, 2> jacobian;
      jacobian.col(0) = a.by_t2.cross(b.value) + a.value.cross(b.by_t2);
      jacobian.col(1) = a.by_t3.cross(b.value) + a.value.cross(b.by_t3);
      const Eigen::Matrix2d normal = jacobian.transpose() * jacobian;
      Eigen::Matrix2d damped = normal;
      damped.diagonal().array() += 1e-14 * normal.trace() + 1e-300;  // a curve of solutions has a singular Jacobian
      const Vector2 change = damped.inverse() * (jacobian.transpose() * a.value.cross(b.value));
      t -= change;
      if (!t.allFinite() || std::abs(t.x() - t2) > far || std::abs(t.y() - t3) > far) {
        return std::nullopt;
      }
      if (change.norm() < 1e-9 * period()) {
        return t;
      }
    }
    return t;
  }

  [[nodiscard]] std::vector<Vector2> distinct_starts() {
    const double cell = same_solution * period();
    const auto order = [cell](const Vector2& a, const Vector2& b) {
      return std::pair(std::round(a.y() / cell), std::round(a.x() / cell)) <
             std::pair(std::round(b.y() / cell), std::round(b.x() / cell));
    };
    std::ranges::stable_sort(starts_, order);
    const auto same = [&order](const Vector2& a, const Vector2& b) { return !order(a, b) && !order(b, a); };
    starts_.erase(std::unique(starts_.begin(), starts_.end(), same), starts_.end());
    return std::move(starts_);
  }

  /// The five equations of paper 002 (eq. 17) at unit scale: both modes' sums as in residual_ratio, and the total.
  struct System {
    Eigen::Matrix<double, 5, 3> by_amplitude;
    Eigen::Matrix<double, 5, 2> by_phase;  ///< derivative with respect to omega*t2, omega*t3
  };

  [[nodiscard]] System system(const Vector2& t, const Vec3& amplitude) const {
    System out;
    for (int i = 0; i < 2; ++i) {
      const std::complex<double> s = poles_[static_cast<std::size_t>(i)];
      const std::array<double, 3> times{0.0, t.x(), t.y()};
      for (int k = 0; k < 3; ++k) {
        const double time = times[static_cast<std::size_t>(k)];
        const std::complex<double> value = std::polar(std::exp(s.real() * (t.y() - time)), -s.imag() * time);
        out.by_amplitude(2 * i, k) = value.real();
        out.by_amplitude(2 * i + 1, k) = value.imag();
        if (k > 0) {
          const std::complex<double> slope = -s / omega_ * amplitude(k) * value;
          out.by_phase(2 * i, k - 1) = slope.real();
          out.by_phase(2 * i + 1, k - 1) = slope.imag();
        }
      }
    }
    out.by_amplitude.row(4).setOnes();
    out.by_phase.row(4).setZero();
    return out;
  }

  /// Newton on times and amplitudes together; minimum-norm steps where the solution is not isolated. Nothing if it does
  /// not converge or leaves the stated range.
  [[nodiscard]] std::optional<Shaper> polish(const Vector2& start) const {
    using Equations = Eigen::Matrix<double, 5, 1>;
    const Equations target = Equations::Unit(4);
    Vector2 t = start;
    Vec3 amplitude = linear_algebra::least_norm_solution(system(t, Vec3::Zero()).by_amplitude, target, small_pivot);
    Vector2 best_t = t;
    Vec3 best_amplitude = amplitude;
    double best = std::numeric_limits<double>::infinity();
    for (int step = 0, stalled = 0; step < newton_steps && stalled < 2; ++step) {
      const System now = system(t, amplitude);
      const Equations error = now.by_amplitude * amplitude - target;
      const double size = error.cwiseAbs().maxCoeff();
      if (!(size < 1e3)) {
        return std::nullopt;
      }
      if (size < best) {
        best = size;
        best_t = t;
        best_amplitude = amplitude;
        stalled = 0;
      } else if (best < 1e-12) {
        ++stalled;
      }
      if (best < 1e-15) {
        break;
      }
      Eigen::Matrix<double, 5, 5> jacobian;
      jacobian << now.by_phase, now.by_amplitude;
      const Equations change = linear_algebra::least_norm_solution(jacobian, error, small_pivot);
      t -= change.head<2>() / omega_;
      amplitude -= change.tail<3>();
    }
    if (best > largest_residual) {
      return std::nullopt;
    }
    return accept(best_t, best_amplitude);
  }

  /// The converged shaper, without a tap that it does not need, if it lies in the stated range.
  [[nodiscard]] std::optional<Shaper> accept(const Vector2& t, const Vec3& amplitude) const {
    const double apart = same_solution * period();
    // the upper end also stops a last tap that ran away: far behind, damping makes anything look cancelled
    if (!(t.x() > apart) || !(t.y() - t.x() > apart) || t.y() > max_duration_s_ ||
        amplitude.cwiseAbs().sum() > max_abs_sum_) {
      return std::nullopt;
    }
    Eigen::Index smallest = 0;
    if (amplitude.cwiseAbs().minCoeff(&smallest) < small_tap) {
      const std::array<double, 3> gaps{t.y() - t.x(), t.y(), t.x()};  // between the two taps that stay
      if (auto pair = two_taps(gaps[static_cast<std::size_t>(smallest)])) {
        return pair;
      }
    }
    return Shaper{{0.0, t.x(), t.y()}, {amplitude(0), amplitude(1), amplitude(2)}};
  }

  /// The ZV shaper of one mode that also cancels the other, if its half period is `gap`.
  [[nodiscard]] std::optional<Shaper> two_taps(double gap) const {
    const std::complex<double>& s = poles_[0];
    const double time = std::round(gap * s.imag() / std::numbers::pi) * std::numbers::pi / s.imag();
    const double sign = std::cos(s.imag() * time) < 0.0 ? 1.0 : -1.0;
    const double first = 1.0;
    const double second = sign * std::exp(s.real() * time);
    const double sum = first + second;
    if (std::abs(time - gap) > 1e-3 * period() || time <= 0.0 ||
        std::abs(sum) * max_abs_sum_ < first + std::abs(second)) {
      return std::nullopt;
    }
    for (const std::complex<double>& each : poles_) {
      const std::complex<double> left =
          first * std::exp(each.real() * time) + second * std::polar(1.0, each.imag() * time);
      if (std::abs(left / sum) > largest_residual) {
        return std::nullopt;
      }
    }
    return Shaper{{0.0, time}, {first / sum, second / sum}};
  }

  /// Of two results at the same times the one with the smaller sum of squares stays.
  void keep(Shaper&& shaper) {
    const double same = same_solution * period();
    const auto known = std::ranges::find_if(solutions_, [&shaper, same](const Shaper& other) {
      return std::ranges::equal(shaper.times_s, other.times_s,
                                [same](double a, double b) { return std::abs(a - b) <= same; });
    });
    const auto squares = [](const Shaper& each) {
      return std::inner_product(each.amplitudes.begin(), each.amplitudes.end(), each.amplitudes.begin(), 0.0);
    };
    if (known == solutions_.end()) {
      solutions_.push_back(std::move(shaper));
    } else if (squares(shaper) < squares(*known) - 1e-9) {
      *known = std::move(shaper);
    }
  }

  /// Ascending in duration, then in the second time; durations within the resolution of the search are equal.
  [[nodiscard]] bool before(const Shaper& a, const Shaper& b) const {
    const double same = same_solution * period();
    const double a_end = std::round(a.times_s.back() / same);
    const double b_end = std::round(b.times_s.back() / same);
    return a_end != b_end ? a_end < b_end : a.times_s[1] < b.times_s[1];
  }

  std::array<std::complex<double>, 2> poles_;
  double omega_;
  double max_duration_s_;
  double max_abs_sum_;
  std::vector<Vector2> starts_;
  std::vector<Shaper> solutions_;
};

void check_range(const Mode& first, const Mode& second, double max_duration_s, double max_abs_sum) {
  const std::complex<double> s1 = pole(first);
  const std::complex<double> s2 = pole(second);
  const double omega = std::max(std::abs(s1), std::abs(s2));
  std::string message;
  if (std::abs(s1 - s2) <= same_pole * omega) {
    message = fmt::format(
        "modes {:.12g} Hz and {:.12g} Hz are the same: their poles differ by {:.12g} of their size, limit {:.12g}; "
        "use a shaper of one mode",
        first.frequency_hz, second.frequency_hz, std::abs(s1 - s2) / omega, same_pole);
  } else if (!std::isfinite(max_duration_s) || max_duration_s <= 0.0 ||
             max_duration_s * omega > most_periods * 2.0 * std::numbers::pi) {
    message = fmt::format(
        "the largest duration is positive and at most {:.12g} periods of the faster mode ({:.12g} s): it is {:.12g} s",
        most_periods, most_periods * 2.0 * std::numbers::pi / omega, max_duration_s);
  } else if (!std::isfinite(max_abs_sum) || max_abs_sum < 1.0) {
    message = fmt::format("the largest sum |a| is at least 1: it is {:.12g}", max_abs_sum);
  } else {
    return;
  }
  throw Error(ErrorKind::argument, message);
}

}  // namespace

std::vector<Shaper> minimal_two_mode(const Mode& first, const Mode& second, double max_duration_s, double max_abs_sum) {
  check_range(first, second, max_duration_s, max_abs_sum);
  return TwoModeSearch(pole(first), pole(second), max_duration_s, max_abs_sum).run();
}

}  // namespace shapegcode
