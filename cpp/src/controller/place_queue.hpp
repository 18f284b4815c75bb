// Queue of items at positions of the path, from the pushing thread to the stepping one.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "controller/shared_state.hpp"

namespace shapegcode {

template <typename What>
class PlaceQueue {
 public:
  struct Entry {
    std::uint64_t segment = 0;  ///< that comes behind it
    What what;
  };
  /// `capacity`: a power of two.
  explicit PlaceQueue(std::size_t capacity) : entries_(capacity) {}

  // Of the thread that pushes.

  /// False: there is no room.
  bool push(std::uint64_t segment, const What& what) noexcept {
    const std::uint64_t end = pushed_.load(std::memory_order_relaxed);
    if (end - taken_.load(std::memory_order_acquire) == entries_.size()) return false;
    entries_[end & (entries_.size() - 1)] = {segment, what};
    pushed_.store(end + 1, std::memory_order_release);
    return true;
  }
  [[nodiscard]] std::uint64_t pushed() const noexcept { return pushed_.load(std::memory_order_relaxed); }

  // Of the thread that steps.

  [[nodiscard]] const Entry* first() const noexcept {
    const std::uint64_t taken = taken_.load(std::memory_order_relaxed);
    if (taken == pushed_.load(std::memory_order_acquire)) return nullptr;
    return &entries_[taken & (entries_.size() - 1)];
  }
  void drop() noexcept { taken_.store(taken_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }
  [[nodiscard]] std::uint64_t taken() const noexcept { return taken_.load(std::memory_order_relaxed); }
  /// All before what was pushed as that number.
  void drop_before(std::uint64_t pushed) noexcept { taken_.store(pushed, std::memory_order_release); }

 private:
  std::vector<Entry> entries_;
  alignas(cache_line) std::atomic<std::uint64_t> pushed_{0};
  alignas(cache_line) std::atomic<std::uint64_t> taken_{0};
};

}  // namespace shapegcode
