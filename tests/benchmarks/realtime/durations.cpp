#include "durations.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string>

namespace realtime {
namespace {

constexpr std::array<std::uint32_t, 23> edges_ns = {
    0,    50,   100,    200,    300,    400,     500,     700,     1000,      1500,       2000,         3000,
    5000, 7000, 10'000, 20'000, 50'000, 100'000, 200'000, 500'000, 1'000'000, 10'000'000, 4'000'000'000};

// One character for each factor of 2.2 that it is above one; 20 for ten million.
std::string bar(std::size_t number) {
  const double length = number == 0 ? 0.0 : 1.0 + std::log(static_cast<double>(number)) / std::log(2.33);
  return std::string(static_cast<std::size_t>(length), '#');
}

std::string in_units(std::uint32_t ns) {
  char text[32];
  if (ns < 1000) {
    std::snprintf(text, sizeof text, "%u ns", ns);
  } else if (ns < 1'000'000) {
    std::snprintf(text, sizeof text, "%g us", 1e-3 * ns);
  } else {
    std::snprintf(text, sizeof text, "%g ms", 1e-6 * ns);
  }
  return text;
}

}  // namespace

void Durations::sort() { std::sort(values_.begin(), values_.begin() + static_cast<std::ptrdiff_t>(count_)); }

std::uint32_t Durations::at(double share) const noexcept {
  if (count_ == 0) return 0;
  return values_[static_cast<std::size_t>(std::llround(share * static_cast<double>(count_ - 1)))];
}

std::size_t Durations::below(std::uint32_t ns) const noexcept {
  const auto end = values_.begin() + static_cast<std::ptrdiff_t>(count_);
  return static_cast<std::size_t>(std::lower_bound(values_.begin(), end, ns) - values_.begin());
}

void print_histogram(const char* first_name, const Durations& first, const char* second_name, const Durations& second) {
  std::printf("  %-20s %12s %-21s %12s\n", "from, to below", first_name, "", second_name);
  bool begun = false;
  for (std::size_t i = 0; i + 1 < edges_ns.size(); ++i) {
    const std::size_t one = first.below(edges_ns[i + 1]) - first.below(edges_ns[i]);
    const std::size_t other = second.below(edges_ns[i + 1]) - second.below(edges_ns[i]);
    const bool more = first.below(edges_ns[i]) < first.count() || second.below(edges_ns[i]) < second.count();
    begun = begun || one > 0 || other > 0;
    if (!begun || !more) continue;
    const bool last = i + 2 == edges_ns.size();
    const std::string range = in_units(edges_ns[i]) + " ... " + (last ? "" : in_units(edges_ns[i + 1]));
    std::printf("  %-20s %12zu %-21s %12zu %s\n", range.c_str(), one, bar(one).c_str(), other, bar(other).c_str());
  }
}

}  // namespace realtime
