// Controls as they are drawn, with somebody at the override and the hold button: what they did wrong once, and others.
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "random_trial.hpp"
#include "sanitized.hpp"

namespace shapegcode::tests {
namespace {

void keeps_its_limits(std::uint32_t seed, const Trial& trial, std::size_t max_steps = max_steps_of_trial) {
  CAPTURE(seed);
  CAPTURE(text_of(trial.settings));
  const Outcome outcome = run_trial(trial, seed, {}, max_steps);
  CHECK(outcome.worst[0] <= 1.001);
  CHECK(outcome.worst[1] <= 1.001);
  CHECK(outcome.worst[2] <= 1.001);
  CHECK(outcome.ended);
  CHECK(outcome.arrived);
  CHECK(outcome.late_plans == 0);  // steps wait for plans
  CHECK(outcome.longest_segment_s <= 20.0);
}

// Each was a fault once: all of them with all trials.
std::vector<std::uint32_t> some_of(std::vector<std::uint32_t> seeds) {
  seeds.resize(trials(static_cast<unsigned>(seeds.size())));
  return seeds;
}

void keeps_its_limits(std::uint32_t seed) { keeps_its_limits(seed, random_trial(seed)); }

}  // namespace

TEST_CASE("any control keeps its limits, whatever the operator does") {
  for (std::uint32_t seed = 1; seed <= trials(15); ++seed) keeps_its_limits(seed);
}

TEST_CASE("any control keeps its limits, whatever its settings and however long its path") {
  for (const std::uint32_t seed : some_of({2U, 3U, 4U, 6U, 8U, 10U}))
    keeps_its_limits(seed, wide_trial(seed), 20'000'000);
}

TEST_CASE("limits are kept where a segment comes too late for its corner") {
  for (const std::uint32_t seed : some_of({1027U, 4436U, 6471U, 12112U, 23312U})) keeps_its_limits(seed);
}

TEST_CASE("limits are kept where the override is raised between the two sides of a corner") {
  for (const std::uint32_t seed : some_of({1240U, 8567U})) keeps_its_limits(seed);
}

TEST_CASE("limits are kept while a shaper follows a position") {
  for (const std::uint32_t seed : some_of({11U, 282U, 373U, 1148U, 1770U, 3026U, 4449U, 4888U})) keeps_its_limits(seed);
}

TEST_CASE("a segment behind a corner at which filters leave the tolerance is not crawled through") {
  for (const std::uint32_t seed : some_of({842U, 1619U})) keeps_its_limits(seed);
}

TEST_CASE("a motion that may not accelerate as planned accelerates less, instead of slowing down") {
  keeps_its_limits(4469U);
}

TEST_CASE("a motion that begins in a rounding finds it as it was, though less is planned there") {
  for (const std::uint32_t seed : some_of({559U})) keeps_its_limits(seed);
}

TEST_CASE("a crawl around a corner is no longer than it has to be") {
  for (const std::uint32_t seed : some_of({1128U, 1765U, 2721U, 9442U})) keeps_its_limits(seed);
}

}  // namespace shapegcode::tests
