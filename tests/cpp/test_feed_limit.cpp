#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "shapegcode/error.hpp"
#include "shapegcode/milling/feed.hpp"

using shapegcode::ChipThickness;
using shapegcode::CuttingCoefficients;
using shapegcode::EndMill;
using shapegcode::EngagedArc;
using shapegcode::EngagementTrack;
using shapegcode::Error;
using shapegcode::FeedLimit;
using shapegcode::FeedLimits;
using shapegcode::ForceFigures;
using shapegcode::largest_feed;
using shapegcode::LimitedFeed;
using shapegcode::MillingForce;
using shapegcode::ToolBeam;

namespace {

constexpr double pi = std::numbers::pi;
using Arcs = std::vector<EngagedArc>;

const EndMill tool{.diameter_mm = 8.0, .flutes = 6, .helix_rad = 50.0 / 180.0 * pi};
const CuttingCoefficients aluminium{
    .specific_n_per_mm2 = 221.3, .specific_exponent = -0.153, .ratio = 0.41, .ratio_exponent = -0.0775};
const Arcs deepest{{-pi / 2, std::asin(2.103 / 4.0 - 1.0), 0.0, 15.0}};
const ToolBeam beam{.overhang_mm = 30.0,
                    .fluted_length_mm = 20.0,
                    .effective_diameter_mm = 6.4,
                    .shank_diameter_mm = 8.0,
                    .young_modulus_gpa = 600.0};

}  // namespace

TEST_CASE("feed limit: a force of constant coefficients grows with the feed, so the feed is exact") {
  CuttingCoefficients constant{.specific_n_per_mm2 = 700.0, .ratio = 0.3};
  MillingForce force(tool, constant, 1800.0);
  const ForceFigures f = force.figures(deepest, 100.0);
  const double bent = force.peak_deflection_um(deepest, 100.0, beam);
  struct Case {
    FeedLimits limits;
    FeedLimit which;
  };
  for (const Case& c : {Case{{.mean_resultant_n = 2.0 * f.mean_resultant_n}, FeedLimit::resultant},
                        Case{{.peak_resultant_n = 2.0 * f.peak_resultant_n}, FeedLimit::resultant},
                        Case{{.peak_deflection_um = 2.0 * bent, .beam = beam}, FeedLimit::deflection},
                        Case{{.peak_torque_nm = 2.0 * f.peak_torque_nm}, FeedLimit::torque},
                        Case{{.mean_power_w = 2.0 * f.mean_power_w}, FeedLimit::power},
                        Case{{.feed_per_tooth_mm = 200.0 / 1800.0 / 6.0}, FeedLimit::chip_load},
                        Case{{.peak_chip_mm = 2.0 * f.peak_chip_mm}, FeedLimit::chip_load}}) {
    CAPTURE(static_cast<int>(c.which));
    const LimitedFeed found = largest_feed(force, deepest, c.limits, 1.0, 5000.0);
    CHECK(found.limit == c.which);
    CHECK(found.within);
    CHECK(found.feed_mm_per_min <= 200.0 * (1.0 + 1e-12));
    CHECK(found.feed_mm_per_min >= 200.0 * (1.0 - 2e-4));
  }
}

TEST_CASE("feed limit: never above, hardly below, whatever binds") {
  std::mt19937 random(5);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  for (int run = 0; run < 200; ++run) {
    CAPTURE(run);
    CuttingCoefficients k = aluminium;
    if (run % 2 == 0) k.thickness = ChipThickness::local;
    if (run % 3 == 0) k.tangential_edge_n_per_mm = k.radial_edge_n_per_mm = draw(0.0, 6.0);
    EndMill cutter = tool;
    cutter.flutes = 1 + run % 4;
    if (run % 5 == 0) {
      for (int i = 0; i < cutter.flutes; ++i) cutter.runout_mm.push_back(draw(-0.01, 0.01));
    }
    MillingForce force(cutter, k, 1800.0);
    const double from = draw(-pi / 2, 0.5);
    const Arcs arcs{{from, from + draw(0.1, 1.0), 0.0, draw(1.0, 15.0)}};
    const FeedLimits limits{.mean_resultant_n = draw(5.0, 100.0),
                            .peak_resultant_n = draw(5.0, 150.0),
                            .peak_deflection_um = draw(2.0, 30.0),
                            .peak_torque_nm = draw(0.02, 0.5),
                            .mean_power_w = draw(3.0, 100.0),
                            .feed_per_tooth_mm = draw(0.02, 0.3),
                            .peak_chip_mm = draw(0.02, 0.3),
                            .beam = beam};
    const LimitedFeed found = largest_feed(force, arcs, limits, 10.0, 3000.0);
    const ForceFigures f = force.figures(arcs, found.feed_mm_per_min);
    const double share =
        std::max({f.mean_resultant_n / limits.mean_resultant_n, f.peak_resultant_n / limits.peak_resultant_n,
                  force.peak_deflection_um(arcs, found.feed_mm_per_min, beam) / limits.peak_deflection_um,
                  f.peak_torque_nm / limits.peak_torque_nm, f.mean_power_w / limits.mean_power_w,
                  force.feed_per_tooth_mm(found.feed_mm_per_min) / limits.feed_per_tooth_mm,
                  f.peak_chip_mm / limits.peak_chip_mm});
    if (!found.within) {
      CHECK(found.feed_mm_per_min == 10.0);
      CHECK(share > 1.0);
      continue;
    }
    CHECK(share <= 1.0 + 1e-12);
    if (found.limit == FeedLimit::none) {
      CHECK(found.feed_mm_per_min == 3000.0);
    } else {
      CHECK(share > 1.0 - 2.1e-4);
    }
  }
}

TEST_CASE("feed limit: constant force in paper 001's corner") {
  MillingForce force(tool, aluminium, 1800.0);
  const Arcs entry{{-pi / 2, std::asin(0.8 / 4.0 - 1.0), 0.0, 15.0}};
  const ForceFigures f = force.figures(entry, 216.0);
  const FeedLimits mean{.mean_resultant_n = f.mean_resultant_n};
  const FeedLimits peak{.peak_resultant_n = f.peak_resultant_n};
  CHECK(largest_feed(force, deepest, mean, 1.0, 216.0).feed_mm_per_min == doctest::Approx(75.7).epsilon(2e-3));
  CHECK(largest_feed(force, deepest, peak, 1.0, 216.0).feed_mm_per_min == doctest::Approx(81.3).epsilon(8e-3));
}

TEST_CASE("feed limit: none met, none reached, none possible") {
  MillingForce force(tool, aluminium, 1800.0);
  const LimitedFeed free = largest_feed(force, {}, {.peak_resultant_n = 1.0}, 10.0, 500.0);
  CHECK(free.feed_mm_per_min == 500.0);
  CHECK(free.limit == FeedLimit::none);
  const LimitedFeed unlimited = largest_feed(force, deepest, {}, 10.0, 500.0);
  CHECK(unlimited.feed_mm_per_min == 500.0);
  CHECK(unlimited.within);
  const LimitedFeed never = largest_feed(force, deepest, {.peak_resultant_n = 1.0}, 10.0, 500.0);
  CHECK(never.feed_mm_per_min == 10.0);
  CHECK(never.limit == FeedLimit::resultant);
  CHECK(!never.within);
  // Edge forces alone are beyond the limit: no feed is within, however low.
  CuttingCoefficients dull = aluminium;
  dull.tangential_edge_n_per_mm = 50.0;
  MillingForce blunt(tool, dull, 1800.0);
  CHECK(!largest_feed(blunt, deepest, {.peak_resultant_n = 20.0}, 1e-9, 500.0).within);
  const LimitedFeed fixed = largest_feed(force, deepest, {.peak_resultant_n = 50.0}, 40.0, 40.0);
  CHECK(fixed.feed_mm_per_min == 40.0);
  CHECK(fixed.within);
}

TEST_CASE("feed limit: along a track, the horizontal part makes the chip") {
  MillingForce force(tool, aluminium, 1800.0);
  EngagementTrack track;
  track.s_mm = {0.0, 1.0, 2.0, 3.0, 4.0};
  track.horizontal = {1.0, 1.0, 0.5, 1.0, 0.0};
  track.arcs = {deepest[0], deepest[0], deepest[0], deepest[0]};
  track.first_arc = {0, 1, 2, 3, 3, 4};
  const FeedLimits limits{.peak_resultant_n = 40.0};
  const auto feeds = shapegcode::largest_feeds(force, track, limits, 10.0, 1000.0);
  REQUIRE(feeds.size() == 5);
  const double level = largest_feed(force, deepest, limits, 10.0, 1000.0).feed_mm_per_min;
  CHECK(feeds[0].feed_mm_per_min == level);
  CHECK(feeds[1].feed_mm_per_min == level);
  CHECK(feeds[2].feed_mm_per_min == doctest::Approx(2.0 * level).epsilon(3e-4));
  CHECK(feeds[2].limit == FeedLimit::resultant);
  CHECK(feeds[3].feed_mm_per_min == 1000.0);
  CHECK(feeds[4].feed_mm_per_min == 1000.0);
}

TEST_CASE("feed limit: refusals") {
  MillingForce force(tool, aluminium, 1800.0);
  CHECK_THROWS_AS((void)largest_feed(force, deepest, {.peak_resultant_n = 0.0}, 1.0, 2.0), Error);
  CHECK_THROWS_AS((void)largest_feed(force, deepest, {.peak_torque_nm = std::nan("")}, 1.0, 2.0), Error);
  CHECK_THROWS_AS((void)largest_feed(force, deepest, {.peak_deflection_um = 1.0}, 1.0, 2.0), Error);
  CHECK_THROWS_AS((void)largest_feed(force, deepest, {}, 0.0, 2.0), Error);
  CHECK_THROWS_AS((void)largest_feed(force, deepest, {}, 3.0, 2.0), Error);
  ToolBeam small = beam;
  small.overhang_mm = 12.0;  // the cut is 15 mm deep
  CHECK_THROWS_AS((void)largest_feed(force, deepest, {.peak_deflection_um = 1.0, .beam = small}, 1.0, 2.0), Error);
}
