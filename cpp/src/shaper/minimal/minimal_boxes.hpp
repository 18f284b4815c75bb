#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstdint>
#include <vector>

#include "shaper/minimal/minimal_starts.hpp"
#include "shaper/minimal/minimal_system.hpp"

// Which shapers can there be? The region of times is cut into boxes. In each, the linearisation of minimal_system.hpp
// with a bound on its second-order rest says in which part of the box solutions can lie, if anywhere: the box is
// dropped, or shrinks, quadratically fast onto a solution, or is halved. Bounds are on derivatives, taken in floating
// point; they leave rounding (1e-16) aside.

namespace shapegcode::minimal {

/// What the boxes settled.
struct BoxCounts {
  std::int64_t boxes = 0;       ///< looked at
  std::int64_t unresolved = 0;  ///< too small to halve on, neither empty nor shrunk onto a solution
  double settled = 0.0;         ///< last phase (rad) up to which every box was settled
};

template <int N>
class BoxSearch {
 public:
  BoxSearch(const System<N>& system, const Region& region, std::int64_t max_boxes, Collection<N>& collection)
      : system_(system), region_(region), max_boxes_(max_boxes), collection_(collection) {}

  /// Slice after slice of the last phase, so that a search that runs out of boxes has settled the short shapers.
  [[nodiscard]] BoxCounts run() {
    constexpr double thickest = 0.5;  // rad
    const double slices = std::ceil(region_.limit / thickest);
    for (int slice = 0; slice < static_cast<int>(slices); ++slice) {
      const double low = region_.limit * slice / slices;
      const double high = region_.limit * (slice + 1) / slices;
      if (!settle(low, high)) {
        break;
      }
      if (counts_.unresolved == 0) {
        counts_.settled = high;
      }
    }
    return counts_;
  }

 private:
  using Phases = typename System<N>::Phases;
  using Square = typename System<N>::Square;
  using Vector = typename System<N>::Vector;
  enum class Verdict : std::uint8_t { empty, solved, open };

  struct Box {
    Phases centre;
    Phases half;
  };

  /// Phases of a cluster of taps whose boxes touch, or of a single one.
  struct Cluster {
    double low;
    double high;
    bool moves;  ///< false: the first tap alone, which stays at zero
  };

  [[nodiscard]] bool settle(double low, double high) {
    Box all{Phases::Constant(0.5 * high), Phases::Constant(0.5 * high)};
    all.centre(N - 1) = 0.5 * (low + high);
    all.half(N - 1) = 0.5 * (high - low);
    stack_.assign(1, all);
    while (!stack_.empty()) {
      if (counts_.boxes >= max_boxes_) {
        return false;
      }
      ++counts_.boxes;
      Box box = stack_.back();
      stack_.pop_back();
      if (look(box) == Verdict::open) {
        halve(box);
      }
    }
    return true;
  }

  void halve(const Box& box) {
    constexpr double smallest = 1e-3;  // rad
    Eigen::Index widest = 0;
    if (box.half.maxCoeff(&widest) < smallest) {
      ++counts_.unresolved;
      return;
    }
    Box part = box;
    part.half(widest) *= 0.5;
    part.centre(widest) = box.centre(widest) - part.half(widest);
    stack_.push_back(part);
    part.centre(widest) = box.centre(widest) + part.half(widest);
    stack_.push_back(part);
  }

  [[nodiscard]] Verdict look(Box& box) {
    constexpr double widest = 0.6;  // rad: in a wider box the second-order rest drowns everything
    constexpr double point = 1e-6;  // rad
    if (out_of_order(box)) {
      return Verdict::empty;
    }
    if (box.half.maxCoeff() > widest) {
      return Verdict::open;
    }
    if (clusters_hold_none(box)) {
      return Verdict::empty;
    }
    for (;;) {
      double left = 1.0;
      if (shrink(box, left)) {
        return Verdict::empty;
      }
      if (box.half.maxCoeff() < point) {
        const auto taps = system_.newton(box.centre, region_.limit);
        if (taps && (taps->phases - box.centre).cwiseAbs().maxCoeff() < 1e3 * point) {
          collection_.add(*taps);
          return Verdict::solved;
        }
        return Verdict::open;
      }
      if (left > 0.5) {
        return Verdict::open;
      }
    }
  }

  [[nodiscard]] bool out_of_order(const Box& box) const {
    bool out = box.centre(0) + box.half(0) <= region_.apart;
    for (int k = 1; k < N; ++k) {
      out = out || box.centre(k) + box.half(k) <= box.centre(k - 1) - box.half(k - 1) + region_.apart;
    }
    return out;
  }

  /// True if the box holds no solution. Otherwise cuts off what of it cannot hold one; `left` is the share of its
  /// volume that stays.
  [[nodiscard]] bool shrink(Box& box, double& left) const {
    Square matrix;
    system_.fill(box.centre, (box.centre + box.half).maxCoeff(), matrix);
    const Square inverse = Eigen::PartialPivLU<Square>(matrix).inverse();
    const Vector x = inverse.col(2 * N);
    if (!inverse.allFinite()) {
      return false;
    }
    // x is off by at most `reach`, which depends on how large the amplitudes can be, which depends on x and `reach`.
    const Square magnitude = inverse.cwiseAbs();
    Phases largest = Phases::Constant(region_.max_abs_sum);
    Vector reach;
    for (int round = 0; round < 3; ++round) {
      const double spread = box.half.cwiseAbs2().cwiseProduct(largest).sum();
      const double most = box.half.cwiseAbs2().maxCoeff() * region_.max_abs_sum;  // the amplitudes share max_abs_sum
      Vector rest;
      for (int i = 0; i < N; ++i) {
        const double speed = system_.speed(i);
        rest(2 * i) = rest(2 * i + 1) = 0.5 * speed * speed * std::min(spread, most);
      }
      rest(2 * N) = 0.0;
      reach = magnitude * rest;
      const auto amplitudes = x.template head<N + 1>().cwiseAbs();
      if ((amplitudes - reach.template head<N + 1>()).cwiseMax(0.0).sum() > region_.max_abs_sum) {
        return true;
      }
      largest = largest.cwiseMin(amplitudes.template tail<N>() + reach.template segment<N>(1));
    }
    for (int k = 0; k < N; ++k) {
      const double amplitude = std::abs(x(k + 1));
      const double product = x(k + 1) < 0.0 ? -x(N + 1 + k) : x(N + 1 + k);
      const double off = reach(k + 1);
      const double low = product - reach(N + 1 + k);
      const double high = product + reach(N + 1 + k);
      if (std::max(low, -high) > box.half(k) * (amplitude + off)) {
        return true;
      }
      if (amplitude > off) {  // the change of the time is product/amplitude
        const double least = std::max(-box.half(k), low / (low < 0.0 ? amplitude - off : amplitude + off));
        const double most = std::min(box.half(k), high / (high < 0.0 ? amplitude + off : amplitude - off));
        if (least > most) {
          return true;
        }
        constexpr double slack = 1e-12;  // rad, for rounding
        const double half = 0.5 * (most - least) + slack;
        left *= std::min(1.0, half / box.half(k));
        box.centre(k) += 0.5 * (least + most);
        box.half(k) = std::min(half, box.half(k));
      }
    }
    return false;
  }

  /// Taps that come together act, to second order, as one tap and its derivative. These are fewer unknowns than there
  /// are conditions: true if the least-squares solution leaves more than the second-order rest can account for.
  [[nodiscard]] bool clusters_hold_none(const Box& box) const {
    std::array<Cluster, N + 1> clusters;
    const int count = clusters_of(box, clusters);
    if (count == N + 1) {
      return false;
    }
    const double end = (box.centre + box.half).maxCoeff();
    Square columns = Square::Zero();
    int used = 0;
    double radius = 0.0;
    for (int c = 0; c < count; ++c) {
      const Cluster& each = clusters[static_cast<std::size_t>(c)];
      radius = std::max(radius, 0.5 * (each.high - each.low));
      const int slope = used + 1;
      for (int i = 0; i < N; ++i) {
        const std::complex<double> s = system_.pole(i);
        const double phase = 0.5 * (each.low + each.high);
        const std::complex<double> value = std::polar(std::exp(s.real() * (end - phase)), -s.imag() * phase);
        columns(2 * i, used) = value.real();
        columns(2 * i + 1, used) = value.imag();
        if (each.moves) {
          const std::complex<double> change = -s * value;
          columns(2 * i, slope) = change.real();
          columns(2 * i + 1, slope) = change.imag();
        }
      }
      columns(2 * N, used) = 1.0;
      used += each.moves ? 2 : 1;
    }
    const Vector left = rest_of_sum(columns, used);
    double rest = 0.0;
    for (int i = 0; i < N; ++i) {
      const double speed = system_.speed(i);
      rest += speed * speed * std::hypot(left(2 * i), left(2 * i + 1));
    }
    return left(2 * N) > 0.5 * region_.max_abs_sum * radius * radius * rest;
  }

  /// The part of the last unit vector that is orthogonal to the first `count` columns, which are overwritten.
  [[nodiscard]] static Vector rest_of_sum(Square& columns, int count) {
    Vector rest = Vector::Unit(2 * N);
    for (int c = 0; c < count; ++c) {
      for (int pass = 0; pass < 2; ++pass) {  // the second removes what rounding left in the first
        for (int before = 0; before < c; ++before) {
          columns.col(c) -= columns.col(before).dot(columns.col(c)) * columns.col(before);
        }
        const double norm = columns.col(c).norm();
        columns.col(c) *= norm > 1e-13 ? 1.0 / norm : 0.0;
      }
      rest -= columns.col(c).dot(rest) * columns.col(c);
    }
    return rest;
  }

  [[nodiscard]] static int clusters_of(const Box& box, std::array<Cluster, N + 1>& clusters) {
    clusters[0] = {0.0, 0.0, false};
    std::size_t last = 0;
    double centre = 0.0;
    double half = 0.0;
    for (int k = 0; k < N; ++k) {
      const double low = box.centre(k) - box.half(k);
      const double high = box.centre(k) + box.half(k);
      if (box.centre(k) - centre <= 2.0 * (half + box.half(k))) {
        Cluster& cluster = clusters[last];
        cluster = {std::min(cluster.low, low), std::max(cluster.high, high), true};
      } else {
        clusters[++last] = {low, high, true};
      }
      centre = box.centre(k);
      half = box.half(k);
    }
    return static_cast<int>(last) + 1;
  }

  const System<N>& system_;
  Region region_;
  std::int64_t max_boxes_;
  Collection<N>& collection_;
  BoxCounts counts_;
  std::vector<Box> stack_;
};

}  // namespace shapegcode::minimal
