// Private: equal entries of two lists, in order.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace shapegcode::detail {

using Matches = std::vector<std::pair<std::size_t, std::size_t>>;

/// The greedy algorithm of Myers (An O(ND) difference algorithm, 1986) between [0, n) and [0, m), `equal(a, b)` asked
/// of entries. Behind every `max_edits` edits what reaches furthest is taken for good, so that lists with little in
/// common cost time and memory in proportion to their length.
template <typename Equal>
class Alignment {
 public:
  Alignment(std::size_t n, std::size_t m, const Equal& equal)
      : n_(static_cast<std::int64_t>(n)), m_(static_cast<std::int64_t>(m)), equal_(equal) {}

  Matches matches() {
    while (a_ < n_ && b_ < m_) {
      advance();
    }
    return std::move(matches_);
  }

 private:
  static constexpr std::int64_t max_edits = 512;
  static constexpr std::int64_t none = -1;
  using Reach = std::vector<std::int64_t>;  // by diagonal a - b from -d - 2 to d + 2: how far along the first list

  // From the diagonals of d - 1 edits: how far the diagonal `k` is reached with one edit more.
  [[nodiscard]] std::int64_t entered(const Reach& before, std::int64_t d, std::int64_t k) const {
    const std::int64_t left = before[static_cast<std::size_t>(k + d)];
    const std::int64_t above = before[static_cast<std::size_t>(k + d + 2)];
    const std::int64_t by_first = left != none && a_ + left < n_ ? left + 1 : none;
    const std::int64_t by_second = above != none && b_ + above - (k + 1) < m_ ? above : none;
    return std::max(by_first, by_second);
  }

  void advance() {
    const std::int64_t n = n_ - a_;
    const std::int64_t m = m_ - b_;
    std::vector<Reach> reached;
    std::int64_t best = 0;
    for (std::int64_t d = 0;; ++d) {
      // Two more on either side, for the diagonals that the next ones are entered from.
      Reach now(static_cast<std::size_t>(2 * d + 5), none);
      best = -d;
      for (std::int64_t k = -d; k <= d; k += 2) {
        std::int64_t x = d == 0 ? 0 : entered(reached.back(), d, k);
        while (x != none && x < n && x - k < m && equal_(at(a_ + x), at(b_ + x - k))) {
          ++x;
        }
        now[static_cast<std::size_t>(k + d + 2)] = x;
        const std::int64_t best_x = now[static_cast<std::size_t>(best + d + 2)];
        best = x != none && (best_x == none || 2 * x - k > 2 * best_x - best) ? k : best;
      }
      reached.push_back(std::move(now));
      const std::int64_t x = reached.back()[static_cast<std::size_t>(best + d + 2)];
      if ((x == n && x - best == m) || d == max_edits) {
        take(reached, best, x);
        return;
      }
    }
  }

  // Back from the end of the last diagonal: the entries that are the same on the way there.
  void take(const std::vector<Reach>& reached, std::int64_t k, std::int64_t x) {
    const std::int64_t end_a = a_ + x;
    const std::int64_t end_b = b_ + x - k;
    const auto first = static_cast<std::ptrdiff_t>(matches_.size());
    for (auto d = static_cast<std::int64_t>(reached.size()) - 1; d >= 0; --d) {
      const std::int64_t from = d == 0 ? 0 : entered(reached[static_cast<std::size_t>(d - 1)], d, k);
      for (; x > from; --x) {
        matches_.emplace_back(at(a_ + x - 1), at(b_ + x - 1 - k));
      }
      if (d > 0) {
        const Reach& before = reached[static_cast<std::size_t>(d - 1)];
        const std::int64_t left = before[static_cast<std::size_t>(k + d)];
        const bool by_first = left != none && a_ + left < n_ && left + 1 == x;
        k += by_first ? -1 : 1;
        x -= by_first ? 1 : 0;
      }
    }
    std::reverse(matches_.begin() + first, matches_.end());
    a_ = end_a;
    b_ = end_b;
  }

  static std::size_t at(std::int64_t index) noexcept { return static_cast<std::size_t>(index); }

  std::int64_t n_;
  std::int64_t m_;
  const Equal& equal_;
  std::int64_t a_ = 0;  // where the part that is not yet aligned begins
  std::int64_t b_ = 0;
  Matches matches_;
};

}  // namespace shapegcode::detail
