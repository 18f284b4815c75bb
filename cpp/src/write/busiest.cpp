#include <algorithm>
#include <cstddef>
#include <span>

#include "shapegcode/write.hpp"

namespace shapegcode {
namespace {

/// One end of a time window that slides over blocks.
struct Edge {
  std::span<const double> durations_s, amounts;
  std::size_t block = 0;
  double begin_s = 0.0;  // of the block
  double passed = 0.0;   // before it

  [[nodiscard]] double amount() const noexcept { return amounts.empty() ? 1.0 : amounts[block]; }
  [[nodiscard]] bool ended() const noexcept { return block == durations_s.size(); }
  [[nodiscard]] double end_s() const noexcept { return begin_s + durations_s[block]; }
  void next() noexcept {
    passed += amount();
    begin_s = end_s();
    ++block;
  }
  /// The amount up to an instant within the block.
  [[nodiscard]] double amount_to(double time_s) const noexcept {
    if (ended() || time_s <= begin_s) return passed;
    return passed + amount() * std::min((time_s - begin_s) / durations_s[block], 1.0);
  }
};

}  // namespace

double busiest_per_s(std::span<const double> durations_s, std::span<const double> amounts, double window_s) noexcept {
  double whole_s = 0.0;
  for (const double duration_s : durations_s) whole_s += duration_s;
  const double window = std::min(window_s, whole_s);
  if (!(window > 0.0)) return 0.0;
  Edge first{durations_s, amounts};
  Edge last = first;
  double largest = 0.0;
  // The amount is piecewise linear in the position of the window: it is largest where a block begins or ends at its
  // edge. Every turn leaves a block behind, whatever the sums were rounded to.
  for (double begin_s = 0.0;;) {
    while (!last.ended() && last.end_s() <= begin_s + window) last.next();
    largest = std::max(largest, last.amount_to(begin_s + window) - first.amount_to(begin_s));
    if (last.ended()) return largest / window;
    const double ends_s = last.end_s() - window;
    Edge& reached = first.end_s() <= ends_s ? first : last;
    begin_s = std::max(begin_s, std::min(first.end_s(), ends_s));
    reached.next();
  }
}

}  // namespace shapegcode
