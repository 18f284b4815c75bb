#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "shaper/minimal/minimal_system.hpp"

namespace shapegcode::minimal {

/// Where a search looks, in radians of the fastest mode, and what it accepts.
struct Region {
  double limit = 0.0;        ///< largest phase of the last tap
  double max_abs_sum = 0.0;  ///< of the amplitudes
  double apart = 0.0;        ///< smallest phase between two taps; closer ones are one tap
};

template <int N>
[[nodiscard]] bool accepts(const Region& region, const Taps<N>& taps) {
  bool apart = taps.phases(0) > region.apart;
  for (int k = 1; k < N; ++k) {
    apart = apart && taps.phases(k) - taps.phases(k - 1) > region.apart;
  }
  return apart && taps.phases(N - 1) <= region.limit && taps.amplitudes.cwiseAbs().sum() <= region.max_abs_sum;
}

/// Distinct solutions, each with how often it was found.
template <int N>
class Collection {
 public:
  Collection(const System<N>& system, const Region& region) : system_(system), region_(region) {}

  /// Counts an isolated solution that the region accepts; false for anything else.
  bool add(const Taps<N>& taps) {
    if (!accepts(region_, taps) || !system_.isolated(taps)) {
      return false;
    }
    constexpr double same = 1e-5;  // rad
    const auto last_phase = [](const Entry& each) { return each.taps.phases(N - 1); };
    auto at = std::ranges::lower_bound(entries_, taps.phases(N - 1) - same, {}, last_phase);
    for (; at != entries_.end() && last_phase(*at) <= taps.phases(N - 1) + same; ++at) {
      if ((at->taps.phases - taps.phases).cwiseAbs().maxCoeff() <= same) {
        ++at->hits;
        return true;
      }
    }
    entries_.insert(std::ranges::upper_bound(entries_, taps.phases(N - 1), {}, last_phase), Entry{taps, 1});
    return true;
  }

  /// How many were found fewer than `hits` times.
  [[nodiscard]] int rarer_than(int hits) const {
    return static_cast<int>(std::ranges::count_if(entries_, [hits](const Entry& each) { return each.hits < hits; }));
  }

  [[nodiscard]] std::vector<Taps<N>> taps() const {
    std::vector<Taps<N>> out;
    out.reserve(entries_.size());
    for (const Entry& each : entries_) {
      out.push_back(each.taps);
    }
    return out;
  }

 private:
  struct Entry {
    Taps<N> taps;
    int hits;
  };

  const System<N>& system_;
  Region region_;
  std::vector<Entry> entries_;  ///< ascending in the last phase
};

/// What the many starts found and how sure that is.
struct StartCounts {
  int starts = 0;
  int converged = 0;   ///< to a solution that the region accepts
  int found_once = 0;  ///< solutions that a single start found
};

/// Low-discrepancy starts of three kinds in turn: evenly spread taps with jitter, which converge most often, times
/// symmetric about their middle, as many solutions of light damping are, and any times at all, which find the rest.
template <int N>
class StartSequence {
 public:
  explicit StartSequence(double limit) : limit_(limit) {
    double root = 1.5;  // of x^(N+2) = x + 1: the additive recurrence of lowest discrepancy known in N+1 dimensions
    for (int i = 0; i < 60; ++i) {
      root = std::pow(1.0 + root, 1.0 / (N + 2));
    }
    for (std::size_t k = 0; k <= N; ++k) {
      step_[k] = std::pow(root, -static_cast<double>(k + 1));
    }
  }

  [[nodiscard]] typename System<N>::Phases next() {
    for (std::size_t k = 0; k <= N; ++k) {
      point_[k] += step_[k];
      point_[k] -= std::floor(point_[k]);
    }
    typename System<N>::Phases out;
    switch (count_++ % 4) {
      case 0:
        out = spread();
        break;
      case 2:
        out = symmetric();
        break;
      default:
        out = Eigen::Map<const typename System<N>::Phases>(point_.data()) * limit_;
    }
    std::sort(out.data(), out.data() + N);
    return out;
  }

 private:
  [[nodiscard]] typename System<N>::Phases spread() const {
    constexpr double least_gap = 0.35;  // beside the jitter of up to 1
    typename System<N>::Phases out;
    double sum = 0.0;
    for (std::size_t k = 0; k < N; ++k) {
      sum += least_gap + point_[k];
      out(static_cast<Eigen::Index>(k)) = sum;
    }
    return out * (limit_ * std::pow(point_[N], 1.0 / N) / sum);
  }

  [[nodiscard]] typename System<N>::Phases symmetric() const {
    constexpr int pairs = (N - 1) / 2;  // beside the two ends
    const double last = limit_ * std::pow(point_[0], 1.0 / (pairs + 1));
    typename System<N>::Phases out;
    out.setConstant(0.5 * last);
    out(N - 1) = last;
    for (int k = 0; k < pairs; ++k) {
      out(2 * k) = 0.5 * last * point_[static_cast<std::size_t>(k) + 1];
      out(2 * k + 1) = last - out(2 * k);
    }
    return out;
  }

  double limit_;
  std::array<double, N + 1> step_{};
  std::array<double, N + 1> point_{};
  int count_ = 0;
};

/// Newton from many starts, until every solution was found three times over or `max_starts` are used up. Then from each
/// solution's mirror image, which is another one where nothing is damped and a good start where little is.
template <int N>
StartCounts search_from_starts(const System<N>& system, const Region& region, int max_starts,
                               Collection<N>& collection) {
  constexpr int batch = 4096;
  constexpr int hits = 3;
  StartCounts counts;
  StartSequence<N> sequence(region.limit);
  while (counts.starts < max_starts && (counts.starts == 0 || collection.rarer_than(hits) > 0)) {
    const int end = std::min(max_starts, counts.starts + batch);
    for (; counts.starts < end; ++counts.starts) {
      const auto taps = system.newton(sequence.next(), region.limit);
      counts.converged += taps && collection.add(*taps) ? 1 : 0;
    }
  }
  counts.found_once = collection.rarer_than(2);
  for (const Taps<N>& each : collection.taps()) {
    typename System<N>::Phases mirror = each.phases;
    for (int k = 0; k + 1 < N; ++k) {
      mirror(k) = each.phases(N - 1) - each.phases(N - 2 - k);
    }
    if (const auto taps = system.newton(mirror, region.limit)) {
      collection.add(*taps);
    }
  }
  return counts;
}

}  // namespace shapegcode::minimal
