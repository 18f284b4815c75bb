// The snapshot of a control that its real-time thread writes and any thread reads.
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "shapegcode/controller.hpp"

namespace shapegcode {

/// What one thread writes and another one reads lies on lines of its own.
inline constexpr std::size_t cache_line = 64;

/// Never locks. The snapshots are written in turn, and the last whole one is read: a thread that interrupts the one
/// that writes finds one. It reads again only where as many were written meanwhile as there is room for but two.
class SharedState {
 public:
  void write(const ControllerState& state) noexcept {
    const std::uint32_t next = (last_.load(std::memory_order_relaxed) + 1) % count;
    Snapshot& snapshot = snapshots_[next];
    const std::uint32_t turn = snapshot.turn.load(std::memory_order_relaxed);
    snapshot.turn.store(turn + 1, std::memory_order_relaxed);
    const auto words = std::bit_cast<Words>(state);
    // A reader that sees a new word sees the odd turn before it too; each word releases and acquires, since
    // ThreadSanitizer does not know fences.
    for (std::size_t i = 0; i < words.size(); ++i) snapshot.words[i].store(words[i], std::memory_order_release);
    snapshot.turn.store(turn + 2, std::memory_order_release);
    last_.store(next, std::memory_order_release);
  }
  [[nodiscard]] ControllerState read() const noexcept {
    Words words;
    for (;;) {
      const Snapshot& snapshot = snapshots_[last_.load(std::memory_order_acquire)];
      const std::uint32_t before = snapshot.turn.load(std::memory_order_acquire);
      for (std::size_t i = 0; i < words.size(); ++i) words[i] = snapshot.words[i].load(std::memory_order_acquire);
      if (before % 2 == 0 && snapshot.turn.load(std::memory_order_relaxed) == before) {
        return std::bit_cast<ControllerState>(words);
      }
    }
  }

 private:
  using Words = std::array<std::uint64_t, sizeof(ControllerState) / sizeof(std::uint64_t)>;
  // No padding: what it holds nobody has written.
  static_assert(sizeof(Words) == sizeof(ControllerState) && offsetof(ControllerState, line) == 4 &&
                offsetof(ControllerState, set_point) == 8);
  static constexpr std::uint32_t count = 4;
  struct alignas(cache_line) Snapshot {
    std::atomic<std::uint32_t> turn{0};
    std::array<std::atomic<std::uint64_t>, std::tuple_size_v<Words>> words{};
  };
  std::array<Snapshot, count> snapshots_{};
  alignas(cache_line) std::atomic<std::uint32_t> last_{0};
};

}  // namespace shapegcode
