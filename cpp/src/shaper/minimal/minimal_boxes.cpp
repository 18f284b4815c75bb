#include "shaper/minimal/minimal_boxes.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>

namespace shapegcode::minimal {

namespace {

/// The part of the last unit vector that is orthogonal to the first `count` columns, which are overwritten.
Vector rest_of_sum(Square& columns, int count) {
  Vector rest = Vector::Unit(columns.rows(), columns.rows() - 1);
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

}  // namespace

BoxCounts BoxSearch::run() {
  constexpr double thickest = 0.5;  // rad
  const double slices = std::ceil(region_.limit / thickest);
  for (int slice = 0; slice < static_cast<int>(slices); ++slice) {
    const double low = region_.limit * slice / slices;
    const double high = region_.limit * (slice + 1) / slices;
    if (!settle(low, high)) {
      break;
    }
    if (counts_.unresolved == 0) {
      counts_.decided_up_to = high;
    }
  }
  return counts_;
}

bool BoxSearch::settle(double low, double high) {
  const int n = system_.modes();
  Box all{Phases::Constant(n, 0.5 * high), Phases::Constant(n, 0.5 * high)};
  all.centre(n - 1) = 0.5 * (low + high);
  all.half(n - 1) = 0.5 * (high - low);
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

void BoxSearch::halve(const Box& box) {
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

BoxSearch::Verdict BoxSearch::look(Box& box) {
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

bool BoxSearch::out_of_order(const Box& box) const {
  bool out = box.centre(0) + box.half(0) <= region_.apart;
  for (int k = 1; k < system_.modes(); ++k) {
    out = out || box.centre(k) + box.half(k) <= box.centre(k - 1) - box.half(k - 1) + region_.apart;
  }
  return out;
}

bool BoxSearch::shrink(Box& box, double& left) const {
  const int n = system_.modes();
  Square inverse;
  system_.fill(box.centre, (box.centre + box.half).maxCoeff(), inverse);
  if (!invert(inverse)) {
    return false;
  }
  const Vector x = inverse.col(2 * n);
  inverse = inverse.cwiseAbs();
  Vector reach;
  if (!bound(box, x, inverse, reach)) {
    return true;
  }
  for (int k = 0; k < n; ++k) {
    const double amplitude = std::abs(x(k + 1));
    const double product = x(k + 1) < 0.0 ? -x(n + 1 + k) : x(n + 1 + k);
    const double off = reach(k + 1);
    const double low = product - reach(n + 1 + k);
    const double high = product + reach(n + 1 + k);
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

// x is off by at most `reach`, which depends on how large the amplitudes can be, which depends on x and `reach`.
bool BoxSearch::bound(const Box& box, const Vector& x, const Square& magnitude, Vector& reach) const {
  const int n = system_.modes();
  Phases largest = Phases::Constant(n, region_.max_abs_sum);
  const double most = box.half.cwiseAbs2().maxCoeff() * region_.max_abs_sum;  // the amplitudes share max_abs_sum
  for (int round = 0; round < 3; ++round) {
    const double spread = box.half.cwiseAbs2().cwiseProduct(largest).sum();
    reach.setZero(2 * n + 1);
    for (int i = 0; i < n; ++i) {
      const double speed = system_.speed(i);
      const double rest = 0.5 * speed * speed * std::min(spread, most);
      reach += rest * (magnitude.col(2 * i) + magnitude.col(2 * i + 1));
    }
    double min_sum = 0.0;
    for (int k = 0; k <= n; ++k) {
      min_sum += std::max(std::abs(x(k)) - reach(k), 0.0);
    }
    if (min_sum > region_.max_abs_sum) {
      return false;
    }
    for (int k = 0; k < n; ++k) {
      largest(k) = std::min(largest(k), std::abs(x(k + 1)) + reach(k + 1));
    }
  }
  return true;
}

bool BoxSearch::clusters_hold_none(const Box& box) const {
  const int n = system_.modes();
  Clusters clusters;
  const int count = clusters_of(box, clusters);
  if (count == n + 1) {
    return false;
  }
  const double end = (box.centre + box.half).maxCoeff();
  Square columns = Square::Zero(2 * n + 1, 2 * n + 1);
  int used = 0;
  double radius = 0.0;
  for (int c = 0; c < count; ++c) {
    const Cluster& each = clusters[static_cast<std::size_t>(c)];
    radius = std::max(radius, 0.5 * (each.high - each.low));
    const int slope = used + 1;
    for (int i = 0; i < n; ++i) {
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
    columns(2 * n, used) = 1.0;
    used += each.moves ? 2 : 1;
  }
  const Vector left = rest_of_sum(columns, used);
  double rest = 0.0;
  for (int i = 0; i < n; ++i) {
    const double speed = system_.speed(i);
    rest += speed * speed * std::hypot(left(2 * i), left(2 * i + 1));
  }
  return left(2 * n) > 0.5 * region_.max_abs_sum * radius * radius * rest;
}

int BoxSearch::clusters_of(const Box& box, Clusters& clusters) const {
  clusters[0] = {0.0, 0.0, false};
  std::size_t last = 0;
  double centre = 0.0;
  double half = 0.0;
  for (int k = 0; k < system_.modes(); ++k) {
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

}  // namespace shapegcode::minimal
