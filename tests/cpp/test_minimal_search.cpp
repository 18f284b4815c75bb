#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/minimal_shapers.hpp"
#include "shapegcode/shaper.hpp"
#include "shaper/minimal/minimal_boxes.hpp"
#include "shaper/minimal/minimal_system.hpp"

using shapegcode::minimal_shapers;
using shapegcode::minimal_two_mode;
using shapegcode::MinimalOptions;
using shapegcode::MinimalShapers;
using shapegcode::Mode;
using shapegcode::Shaper;

namespace {

double largest_residual(const std::vector<Shaper>& shapers, const std::vector<Mode>& modes) {
  double largest = 0.0;
  for (const Shaper& shaper : shapers) {
    for (const Mode& mode : modes) {
      largest = std::max(largest, residual_ratio(shaper, mode));
    }
  }
  return largest;
}

/// The shaper of `shapers` with these times (s), or null.
const Shaper* with_times(const std::vector<Shaper>& shapers, const std::vector<double>& times, double tolerance) {
  const auto found = std::ranges::find_if(shapers, [&](const Shaper& each) {
    return std::ranges::equal(each.times_s, times,
                              [tolerance](double a, double b) { return std::abs(a - b) <= tolerance; });
  });
  return found == shapers.end() ? nullptr : &*found;
}

}  // namespace

TEST_CASE("minimal_shapers: one mode is the ZV shaper and its later relatives") {
  const Mode mode{2.0, 0.1};
  const MinimalShapers found = minimal_shapers(std::array{mode}, 0.8);
  const double half = shapegcode::duration_s(shapegcode::zv(mode));
  REQUIRE(found.complete);
  REQUIRE(found.shapers.size() == 3);  // two, three half periods too: the sum of the even one is .47
  CHECK(found.shapers[0].times_s == shapegcode::zv(mode).times_s);
  CHECK(std::abs(found.shapers[0].amplitudes[1] - shapegcode::zv(mode).amplitudes[1]) < 1e-15);
  for (std::size_t k = 0; k < 3; ++k) {
    CHECK(std::abs(duration_s(found.shapers[k]) - static_cast<double>(k + 1) * half) < 1e-15);
    CHECK(has_negative(found.shapers[k]) == (k == 1));
  }
  CHECK(largest_residual(found.shapers, {mode}) < 1e-15);
}

TEST_CASE("minimal_shapers: two modes are the complete two-mode search") {
  const std::array<Mode, 2> modes{Mode{46.0, 0.02}, Mode{131.0, 0.02}};
  const MinimalShapers found = minimal_shapers(modes, 0.06);
  CHECK(found.complete);
  CHECK(found.shapers == minimal_two_mode(modes[0], modes[1], 0.06));
}

TEST_CASE("minimal_shapers: the boxes of two modes find what the two-mode search finds, and settle everything") {
  using namespace shapegcode::minimal;
  for (const double damping : {0.0, 0.02, 0.2}) {
    for (const double ratio : {1.1, 1.7, 2.0, 2.85, 4.0, 8.0}) {
      const double duration = 1.5;
      const std::array<std::complex<double>, 2> poles{shapegcode::pole({1.0, damping}),
                                                      shapegcode::pole({ratio, damping})};
      const double omega = std::abs(poles[1]);
      const System system(poles, omega);
      const Region region{duration * omega * (1.0 + 1e-9), 10.0, 1e-4};
      Collection collection(system, region);
      const BoxCounts counts = BoxSearch(system, region, 1'000'000, collection).run();
      CHECK(counts.unresolved == 0);
      CHECK(counts.decided_up_to >= duration * omega);
      const std::vector<Shaper> listed = minimal_two_mode({1.0, damping}, {ratio, damping}, duration);
      const std::vector<Taps> taps = collection.taps();
      REQUIRE(taps.size() == listed.size());
      for (const Taps& each : taps) {
        CHECK(with_times(listed, {0.0, each.phases(0) / omega, each.phases(1) / omega}, 1e-9) != nullptr);
      }
    }
  }
}

TEST_CASE("minimal_shapers: harmonics 1 ... n, undamped, are cancelled by n+1 equal taps 1/(n+1) apart") {
  std::vector<Mode> modes;
  for (std::size_t n = 1; n <= 6; ++n) {
    modes.push_back({static_cast<double>(n), 0.0});
    MinimalOptions options;
    options.max_boxes = n <= 3 ? options.max_boxes : 0;
    const MinimalShapers found = minimal_shapers(modes, 1.0, options);
    std::vector<double> times;
    for (std::size_t k = 0; k <= n; ++k) {
      times.push_back(static_cast<double>(k) / static_cast<double>(n + 1));
    }
    const Shaper* uniform = with_times(found.shapers, times, 1e-12);
    REQUIRE(uniform != nullptr);
    for (const double amplitude : uniform->amplitudes) {
      CHECK(std::abs(amplitude - 1.0 / static_cast<double>(n + 1)) < 1e-12);
    }
    CHECK(found.complete == (n <= 3));
    CHECK(largest_residual(found.shapers, modes) < 1e-12);
  }
}

TEST_CASE("minimal_shapers: undamped shapers come with their mirror images") {
  const std::array<Mode, 3> modes{Mode{20.0, 0.0}, Mode{71.0, 0.0}, Mode{160.0, 0.0}};
  const MinimalShapers found = minimal_shapers(modes, 0.0352);
  REQUIRE(found.complete);
  REQUIRE(found.shapers.size() == 20);
  for (const Shaper& each : found.shapers) {
    std::vector<double> mirrored;
    for (std::size_t k = each.times_s.size(); k-- > 0;) {
      mirrored.push_back(duration_s(each) - each.times_s[k]);
    }
    CHECK(with_times(found.shapers, mirrored, 1e-9) != nullptr);
  }
}

TEST_CASE("minimal_shapers: starts and boxes find the same") {
  const std::array<Mode, 3> modes{Mode{20.0, 0.02}, Mode{71.0, 0.05}, Mode{160.0, 0.01}};
  MinimalOptions boxes_only;
  boxes_only.max_starts = 0;
  MinimalOptions starts_only;
  starts_only.max_boxes = 0;
  const MinimalShapers by_boxes = minimal_shapers(modes, 0.0352, boxes_only);
  const MinimalShapers by_starts = minimal_shapers(modes, 0.0352, starts_only);
  CHECK(by_boxes.complete);
  CHECK(by_boxes.starts == 0);
  CHECK_FALSE(by_starts.complete);
  CHECK(by_starts.complete_up_to_s == 0.0);
  REQUIRE(!by_boxes.shapers.empty());
  REQUIRE(by_boxes.shapers.size() == by_starts.shapers.size());
  for (const Shaper& each : by_boxes.shapers) {
    CHECK(with_times(by_starts.shapers, each.times_s, 1e-9) != nullptr);
  }
}

TEST_CASE("minimal_shapers: a search that runs out of boxes has decided the short shapers") {
  const std::array<Mode, 3> modes{Mode{20.0, 0.02}, Mode{71.0, 0.02}, Mode{160.0, 0.02}};
  MinimalOptions options;
  options.max_boxes = 20'000;
  const MinimalShapers found = minimal_shapers(modes, 0.0352, options);
  CHECK_FALSE(found.complete);
  CHECK(found.boxes == 20'000);
  CHECK(found.complete_up_to_s > 0.01);
  CHECK(found.complete_up_to_s < 0.0352);
}

TEST_CASE("minimal_shapers: modes that one ZV serves") {
  const std::array<Mode, 3> modes{Mode{1.0, 0.0}, Mode{3.0, 0.0}, Mode{5.0, 0.0}};
  MinimalOptions options;
  options.max_boxes = 20'000;
  const MinimalShapers found = minimal_shapers(modes, 0.7, options);
  REQUIRE(found.shapers.size() == 1);  // what is not isolated is left out
  CHECK(found.shapers[0].times_s == std::vector<double>{0.0, 0.5});
  CHECK_FALSE(found.complete);
}

TEST_CASE("minimal_shapers: what it refuses") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refused = [](const std::vector<Mode>& modes, double duration, const MinimalOptions& options = {}) {
    CHECK_THROWS_AS(static_cast<void>(minimal_shapers(modes, duration, options)), shapegcode::Error);
  };
  refused({}, 1.0);
  refused({{1.0}, {2.0}, {3.0}, {4.0}, {5.0}, {6.0}, {7.0}}, 1.0);
  refused({{1.0}, {2.0}, {1.0 + 1e-8}}, 1.0);
  refused({{1.0}, {2.0, 1.0}}, 1.0);
  refused({{1.0}, {2.0}, {4.0}}, 0.0);
  refused({{1.0}, {2.0}, {4.0}}, nan);
  refused({{1.0}, {2.0}, {4.0}}, 26.0);
  refused({{1.0}, {2.0}}, 1.0, {.max_abs_sum = 0.5});
  refused({{1.0}, {2.0}}, 1.0, {.max_abs_sum = nan});
  refused({{1.0}, {2.0}}, 1.0, {.max_starts = -1});
  refused({{1.0}, {2.0}}, 1.0, {.max_boxes = -1});
}

TEST_CASE("minimal_branches: the uniform families of two undamped modes are one curve each") {
  std::vector<double> ratios;
  for (int i = 0; i < 60; ++i) {
    ratios.push_back(1.31 + 0.02 * i);
  }
  const shapegcode::MinimalBranches map = shapegcode::minimal_branches({1.0, 0.0}, 0.0, ratios, 0.9);
  REQUIRE(map.branches > 0);
  REQUIRE(map.times_s.size() == map.branches * ratios.size() * 3);
  for (std::size_t at = 0; at < ratios.size(); ++at) {
    const double spacing = 1.0 / (1.0 + ratios[at]);
    CHECK(std::abs(map.times_s[at * 3 + 1] - spacing) < 1e-12);  // the shortest at the first ratio: curve 0
    CHECK(std::abs(map.times_s[at * 3 + 2] - 2.0 * spacing) < 1e-12);
    const double middle = -2.0 * std::cos(2.0 * 3.14159265358979323846 * spacing);
    CHECK(std::abs(map.amplitudes[at * 3 + 1] - middle / (2.0 + middle)) < 1e-9);
  }
}

TEST_CASE("minimal_branches: what it refuses") {
  const auto refused = [](const std::vector<double>& ratios) {
    CHECK_THROWS_AS(static_cast<void>(shapegcode::minimal_branches({1.0, 0.0}, 0.0, ratios, 0.9)), shapegcode::Error);
  };
  refused({});
  refused({2.0, 1.5});
  refused({2.0, 2.0});
  refused({-1.0, 2.0});
  refused({2.0, std::numeric_limits<double>::infinity()});
}
