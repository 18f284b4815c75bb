// The snapshot of a control that its real-time thread writes and any thread reads.
#pragma once

#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "shapegcode/controller.hpp"

namespace shapegcode {

/// Never locks: readers try again while it is being written. A reader that sees a new word sees the odd turn before it
/// too; each word releases and acquires, since ThreadSanitizer does not know fences.
class SharedState {
 public:
  void write(const ControllerState& state) noexcept {
    const std::uint32_t turn = turn_.load(std::memory_order_relaxed);
    turn_.store(turn + 1, std::memory_order_relaxed);
    const auto words = std::bit_cast<Words>(state);
    for (std::size_t i = 0; i < words.size(); ++i) words_[i].store(words[i], std::memory_order_release);
    turn_.store(turn + 2, std::memory_order_release);
  }
  [[nodiscard]] ControllerState read() const noexcept {
    Words words;
    for (;;) {
      const std::uint32_t before = turn_.load(std::memory_order_acquire);
      for (std::size_t i = 0; i < words.size(); ++i) words[i] = words_[i].load(std::memory_order_acquire);
      if (before % 2 == 0 && turn_.load(std::memory_order_relaxed) == before) {
        return std::bit_cast<ControllerState>(words);
      }
    }
  }

 private:
  using Words = std::array<std::uint64_t, sizeof(ControllerState) / sizeof(std::uint64_t)>;
  static_assert(sizeof(Words) == sizeof(ControllerState));
  std::atomic<std::uint32_t> turn_{0};
  std::array<std::atomic<std::uint64_t>, std::tuple_size_v<Words>> words_{};
};

}  // namespace shapegcode
