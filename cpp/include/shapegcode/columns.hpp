#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

namespace shapegcode {

/// A growing array stored in blocks: it grows without copying its values, and unused memory is less than one block.
template <typename Value>
class Column {
 public:
  void push_back(const Value& value) {
    if (size_ % block_size == 0) {
      blocks_.emplace_back();
      if (size_ > 0) blocks_.back().reserve(block_size);
    }
    blocks_.back().push_back(value);
    ++size_;
  }
  [[nodiscard]] const Value& operator[](std::size_t i) const noexcept {
    return blocks_[i / block_size][i % block_size];
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// Frees the unused memory, which in a short column may be as large as the used memory.
  void fit() {
    if (!blocks_.empty()) blocks_.back().shrink_to_fit();
  }
  /// Frees the memory of the values before `i`; they must not be read again.
  void forget_before(std::size_t i) noexcept {
    for (; forgotten_ < i / block_size; ++forgotten_) std::vector<Value>().swap(blocks_[forgotten_]);
  }

 private:
  // Large enough that freed memory returns to the operating system at once.
  static constexpr std::size_t block_size = std::bit_ceil((std::size_t{1} << 20U) / sizeof(Value));

  std::vector<std::vector<Value>> blocks_;
  std::size_t size_ = 0;
  std::size_t forgotten_ = 0;  // blocks
};

/// A growing array of values that seldom change: a block of bit-identical values takes the memory of one value.
template <typename Value>
class SteadyColumn {
 public:
  void push_back(const Value& value) {
    const std::size_t within = size_ % block_size;
    ++size_;
    if (within == 0) {
      blocks_.push_back({value, {}});
      return;
    }
    auto& [first, values] = blocks_.back();
    if (values.empty()) {
      if (same(first, value)) return;
      if (size_ > block_size) values.reserve(block_size);
      values.assign(within, first);
    }
    values.push_back(value);
  }
  [[nodiscard]] const Value& operator[](std::size_t i) const noexcept {
    const Block& block = blocks_[i / block_size];
    return block.values.empty() ? block.first : block.values[i % block_size];
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }

 private:
  static constexpr std::size_t block_size = 256;

  struct Block {
    Value first;
    std::vector<Value> values;  // empty: all are the first
  };
  static bool same(const Value& a, const Value& b) noexcept {
    if constexpr (std::is_same_v<Value, double>) {
      return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
    } else {
      return a == b;
    }
  }

  std::vector<Block> blocks_;
  std::size_t size_ = 0;
};

}  // namespace shapegcode
