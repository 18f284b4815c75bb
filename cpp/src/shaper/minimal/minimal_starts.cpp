#include "shaper/minimal/minimal_starts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

namespace shapegcode::minimal {

bool accepts(const Region& region, const Taps& taps) {
  const Eigen::Index n = taps.phases.size();
  bool apart = taps.phases(0) > region.apart;
  for (Eigen::Index k = 1; k < n; ++k) {
    apart = apart && taps.phases(k) - taps.phases(k - 1) > region.apart;
  }
  return apart && taps.phases(n - 1) <= region.limit && taps.amplitudes.cwiseAbs().sum() <= region.max_abs_sum;
}

bool Collection::add(const Taps& taps) {
  if (!accepts(region_, taps) || !system_.isolated(taps)) {
    return false;
  }
  constexpr double same = 1e-5;  // rad
  const Eigen::Index end = taps.phases.size() - 1;
  const auto last_phase = [end](const Entry& each) { return each.taps.phases(end); };
  auto at = std::ranges::lower_bound(entries_, taps.phases(end) - same, {}, last_phase);
  for (; at != entries_.end() && last_phase(*at) <= taps.phases(end) + same; ++at) {
    if ((at->taps.phases - taps.phases).cwiseAbs().maxCoeff() <= same) {
      ++at->hits;
      return true;
    }
  }
  entries_.insert(std::ranges::upper_bound(entries_, taps.phases(end), {}, last_phase), Entry{taps, 1});
  return true;
}

int Collection::rarer_than(int hits) const {
  return static_cast<int>(std::ranges::count_if(entries_, [hits](const Entry& each) { return each.hits < hits; }));
}

std::vector<Taps> Collection::taps() const {
  std::vector<Taps> out;
  out.reserve(entries_.size());
  for (const Entry& each : entries_) {
    out.push_back(each.taps);
  }
  return out;
}

namespace {

/// Low-discrepancy starts of three kinds in turn: evenly spread impulses with jitter, which converge most often; times
/// symmetric about their middle, like many solutions with light damping; and arbitrary times, which find the rest.
class StartSequence {
 public:
  StartSequence(int modes, double limit) : modes_(static_cast<std::size_t>(modes)), limit_(limit) {
    double root = 1.5;  // of x^(n+2) = x + 1: the additive recurrence of lowest discrepancy known in n+1 dimensions
    for (int i = 0; i < 60; ++i) {
      root = std::pow(1.0 + root, 1.0 / (modes + 2));
    }
    for (std::size_t k = 0; k <= modes_; ++k) {
      step_[k] = std::pow(root, -static_cast<double>(k + 1));
    }
  }

  [[nodiscard]] Phases next() {
    for (std::size_t k = 0; k <= modes_; ++k) {
      point_[k] += step_[k];
      point_[k] -= std::floor(point_[k]);
    }
    Phases out(static_cast<Eigen::Index>(modes_));
    switch (count_++ % 4) {
      case 0:
        spread(out);
        break;
      case 2:
        symmetric(out);
        break;
      default:
        for (std::size_t k = 0; k < modes_; ++k) {
          out(static_cast<Eigen::Index>(k)) = point_[k] * limit_;
        }
    }
    for (Eigen::Index k = 1; k < out.size(); ++k) {
      for (Eigen::Index at = k; at > 0 && out(at) < out(at - 1); --at) {
        std::swap(out(at), out(at - 1));
      }
    }
    return out;
  }

 private:
  void spread(Phases& out) const {
    constexpr double min_gap = 0.35;  // beside the jitter of up to 1
    double sum = 0.0;
    for (std::size_t k = 0; k < modes_; ++k) {
      sum += min_gap + point_[k];
      out(static_cast<Eigen::Index>(k)) = sum;
    }
    out *= limit_ * std::pow(point_[modes_], 1.0 / static_cast<double>(modes_)) / sum;
  }

  void symmetric(Phases& out) const {
    const std::size_t pairs = (modes_ - 1) / 2;  // beside the two ends
    const double last = limit_ * std::pow(point_[0], 1.0 / static_cast<double>(pairs + 1));
    out.setConstant(0.5 * last);
    out(out.size() - 1) = last;
    for (std::size_t k = 0; k < pairs; ++k) {
      const auto first = static_cast<Eigen::Index>(2 * k);
      out(first) = 0.5 * last * point_[k + 1];
      out(first + 1) = last - out(first);
    }
  }

  std::size_t modes_;
  double limit_;
  std::array<double, max_modes + 1> step_{};
  std::array<double, max_modes + 1> point_{};
  int count_ = 0;
};

}  // namespace

StartCounts search_from_starts(const System& system, const Region& region, int max_starts, Collection& collection) {
  constexpr int batch = 4096;
  constexpr int hits = 3;
  StartCounts counts;
  StartSequence sequence(system.modes(), region.limit);
  while (counts.starts < max_starts && (counts.starts == 0 || collection.rarer_than(hits) > 0)) {
    const int end = std::min(max_starts, counts.starts + batch);
    for (; counts.starts < end; ++counts.starts) {
      const auto taps = system.newton(sequence.next(), region.limit);
      counts.converged += taps && collection.add(*taps) ? 1 : 0;
    }
  }
  counts.found_once = collection.rarer_than(2);
  for (const Taps& each : collection.taps()) {
    Phases mirror = each.phases;
    const Eigen::Index n = mirror.size();
    for (Eigen::Index k = 0; k + 1 < n; ++k) {
      mirror(k) = each.phases(n - 1) - each.phases(n - 2 - k);
    }
    if (const auto taps = system.newton(mirror, region.limit)) {
      collection.add(*taps);
    }
  }
  return counts;
}

}  // namespace shapegcode::minimal
