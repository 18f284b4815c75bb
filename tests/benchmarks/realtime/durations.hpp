// Many durations in ns: kept one by one in memory that is touched before, sorted at the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace realtime {

class Durations {
 public:
  explicit Durations(std::size_t most) : values_(most, 1) {}

  void add(std::int64_t ns) noexcept {
    constexpr std::int64_t longest = std::numeric_limits<std::uint32_t>::max();
    if (count_ < values_.size())
      values_[count_++] = static_cast<std::uint32_t>(ns < 0 ? 0 : ns < longest ? ns : longest);
  }
  void clear() noexcept { count_ = 0; }
  /// Ends the collection: what follows may be called from then on.
  void sort();

  [[nodiscard]] std::size_t count() const noexcept { return count_; }
  [[nodiscard]] std::uint32_t at(double share) const noexcept;
  [[nodiscard]] std::uint32_t worst() const noexcept { return at(1.0); }
  /// How many are below.
  [[nodiscard]] std::size_t below(std::uint32_t ns) const noexcept;

 private:
  std::vector<std::uint32_t> values_;
  std::size_t count_ = 0;
};

/// Two of them beside each other, one line for each range; the bars are logarithmic.
void print_histogram(const char* first_name, const Durations& first, const char* second_name, const Durations& second);

}  // namespace realtime
