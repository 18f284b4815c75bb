// What LinuxCNC's component is made of, without LinuxCNC; tests/linuxcnc runs it there.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "grid_shaper.hpp"
#include "sanitized.hpp"
#include "shapegcode/error.hpp"
#include "shapegcode_hal.h"
#include "switching_filter.hpp"

using shapegcode::Error;
using shapegcode::Fir;
using shapegcode::make_shaper;
using shapegcode::Mode;
using shapegcode::residual_ratio;
using shapegcode::Shaper;
using shapegcode::linuxcnc::design;
using shapegcode::linuxcnc::OfferedFilter;
using shapegcode::linuxcnc::SwitchingFilter;
using shapegcode::linuxcnc::vibration_limit;
using shapegcode::linuxcnc::Wish;
using shapegcode::tests::trials;

namespace {

constexpr double period_s = 1e-3;

Wish wish_for(int family, double frequency_hz, double damping_ratio) {
  return {true, family, {frequency_hz, 0.0, 0.0}, {damping_ratio, 0.0, 0.0}};
}

/// The taps of a filter as a shaper, whose residual is computed from the definition.
Shaper shaper_of(const Fir& fir) {
  std::vector<double> times;
  for (const int delay : fir.delays()) times.push_back(delay * period_s);
  return make_shaper(times, fir.taps());
}

std::string refusal(const Wish& wish) {
  try {
    static_cast<void>(design(wish, period_s));
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

/// Positions of a point that moves at 0.1 per sample and rests from sample 100 to 200.
double moved(int sample) { return 0.1 * (sample - std::clamp(sample - 100, 0, 100)); }

std::string last_report;
void report(const char* line) { last_report = line; }

}  // namespace

TEST_CASE("linuxcnc shaper: the families keep their zeros on the thread's samples") {
  for (const double frequency_hz : {3.0, 17.3, 46.0, 131.7, 249.0}) {
    for (const double damping : {0.0, 0.02, 0.15}) {
      for (int family = 0; family <= 6; ++family) {
        const Fir fir = design(wish_for(family, frequency_hz, damping), period_s);
        CAPTURE(frequency_hz);
        CAPTURE(damping);
        CAPTURE(family);
        CHECK(std::ranges::all_of(fir.taps(), [](double tap) { return tap >= -1e-15; }));
        const double left = residual_ratio(shaper_of(fir), {frequency_hz, damping});
        const bool hump_at_mode = family == 4 || family == 6;
        CHECK(left <= (hump_at_mode ? vibration_limit : 1e-13));
        if (hump_at_mode && frequency_hz < 50.0) CHECK(left > 0.9 * vibration_limit);
      }
    }
  }
}

TEST_CASE("linuxcnc shaper: repeated zeros are repeated") {
  const auto beside = [](int family) {
    return residual_ratio(shaper_of(design(wish_for(family, 46.0, 0.02), period_s)), {46.0 * 1.0001, 0.02});
  };
  CHECK(beside(0) > 1e-5);
  CHECK(beside(1) < 1e-7);
  CHECK(beside(2) < 1e-11);
}

TEST_CASE("linuxcnc shaper: modes in series") {
  const Wish wish{true, 0, {46.0, 0.0, 80.0}, {0.02, 0.5, 0.03}};
  const Shaper shaper = shaper_of(design(wish, period_s));
  CHECK(residual_ratio(shaper, {46.0, 0.02}) < 1e-13);
  CHECK(residual_ratio(shaper, {80.0, 0.03}) < 1e-13);
}

TEST_CASE("linuxcnc shaper: off is the command itself") {
  Wish off = wish_for(99, -1.0, 7.0);
  off.enable = false;
  CHECK(design(off, period_s).taps() == std::vector{1.0});
}

TEST_CASE("linuxcnc shaper: what is impossible is refused") {
  CHECK(refusal(wish_for(7, 46.0, 0.02)).starts_with("family 7 is none"));
  CHECK(refusal(wish_for(-1, 46.0, 0.02)).starts_with("family -1 is none"));
  CHECK(refusal(wish_for(0, 0.0, 0.02)) == "no mode is given: every frequency is 0");
  CHECK(refusal(wish_for(0, 251.0, 0.0)) == "a mode at 251 Hz is too fast for a thread of 1 ms: at most 250 Hz");
  CHECK(refusal(wish_for(0, 0.2, 0.0)).starts_with("the shaper of a mode at 0.2 Hz lasts 2.5 s"));
  CHECK(refusal(wish_for(2, 0.6, 0.0)).starts_with("the shapers of all modes last 2.5"));
  CHECK(refusal(wish_for(0, 46.0, 1.0)) != "accepted");
  CHECK(refusal(wish_for(0, -46.0, 0.0)) != "accepted");
  CHECK(refusal(wish_for(0, std::nan(""), 0.0)) != "accepted");
  CHECK(refusal(wish_for(6, 46.0, 0.6)) != "accepted");
}

TEST_CASE("linuxcnc filter: without a fade it waits for rest, with one it is exact before and behind") {
  const std::vector<int> delays{0, 10};
  for (const double fade : {0.0, 20.0}) {
    CAPTURE(fade);
    SwitchingFilter filter(1);
    filter.offer(std::make_unique<OfferedFilter>(Fir(delays, {0.25, 0.75}), 1, 1));
    int switched = 0;
    double last = 0.0;
    for (int sample = 0; sample < 400; ++sample) {
      double value = moved(sample);
      filter.step({&value, 1}, {&value, 1}, fade);
      const double filtered = 0.25 * moved(sample) + 0.75 * moved(std::max(sample - 10, 0));
      if (filter.active().wish == 1 && switched == 0) switched = sample;
      if (switched == 0 && fade == 0.0) CHECK(value == moved(sample));
      if (switched != 0) CHECK(value == doctest::Approx(filtered).epsilon(1e-14));
      CHECK(value - last <= 0.1 * (1.0 + 1e-9));
      CHECK(value >= last - 1e-12);
      last = value;
    }
    CHECK(switched == (fade == 0.0 ? 111 : 29));
    filter.clean_up();
  }
}

TEST_CASE("linuxcnc filter: of several offers the last one counts, and one that is taken is finished first") {
  SwitchingFilter filter(2);
  for (const std::uint64_t wish : {1U, 2U})
    filter.offer(std::make_unique<OfferedFilter>(Fir({0, 5}, {0.5, 0.5}), 2, wish));
  std::array<double, 2> values{3.0, 4.0};
  for (int sample = 0; sample < 20; ++sample) filter.step(values, values, 0.0);
  CHECK(filter.active().wish == 2);
  filter.offer(std::make_unique<OfferedFilter>(Fir({0}, {1.0}), 2, 3));
  for (int sample = 0; sample < 20; ++sample) filter.step(values, values, 0.0);
  CHECK(filter.active().wish == 2);  // the place for what is done with is still taken
  filter.clean_up();
  for (int sample = 0; sample < 20; ++sample) filter.step(values, values, 0.0);
  CHECK(filter.active().wish == 3);
  CHECK(values == std::array{3.0, 4.0});
}

TEST_CASE("linuxcnc C interface: a design comes from the other thread, one that is impossible does not") {
  shapegcode_hal_slot slot{};
  REQUIRE(shapegcode_hal_open(&slot, 2, report) == 0);
  shapegcode_hal_settings settings{1, 0, {46.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, 0.0, period_s};
  shapegcode_hal_status status{};
  std::array<double, 2> in{1.0, 2.0};
  std::array<double, 2> out{};
  const auto step_until = [&](auto&& done) {
    for (int k = 0; k < 10'000; ++k) {
      shapegcode_hal_run(&slot, 2, &settings, in.data(), out.data(), &status);
      if (done()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  };
  settings.enabled = 0;
  CHECK(step_until([&] { return in[0] += 0.1, status.waiting == 0; }));  // off is what it is already
  settings.enabled = 1;
  CHECK(step_until([&] { return status.waiting == 0; }));
  CHECK(status.possible == 1);
  CHECK(status.duration_s == doctest::Approx(0.011));
  CHECK(status.delay_s == doctest::Approx(0.25 / 46.0).epsilon(0.01));
  for (int k = 0; k < 20; ++k) shapegcode_hal_run(&slot, 2, &settings, in.data(), out.data(), &status);  // what it held
  // In rounding only: how long the other thread took decides what it is of.
  for (std::size_t axis = 0; axis < in.size(); ++axis) CHECK(out[axis] == doctest::Approx(in[axis]).epsilon(1e-12));
  settings.family_number = 12;
  CHECK(step_until([&] { return status.possible == 0; }));
  CHECK(status.waiting == 0);
  CHECK(status.duration_s == doctest::Approx(0.011));
  CHECK(last_report.starts_with("family 12 is none"));
  settings.enabled = 0;
  CHECK(step_until([&] { return status.possible == 1 && status.waiting == 0; }));
  CHECK(status.delay_s == 0.0);
  CHECK(shapegcode_hal_close(&slot) == SHAPEGCODE_HAL_NOT_RUNNING);
  CHECK(shapegcode_hal_open(&slot, 0, report) == -1);
  CHECK(slot.hal == nullptr);
}

// Under ThreadSanitizer as `make threads`, under the address sanitizer with the others.
TEST_CASE("linuxcnc slot: a filter is opened and closed hundreds of times while a thread runs it") {
  shapegcode_hal_slot slot{};
  std::atomic<bool> ends = false;
  std::atomic<int> wrong = 0;
  std::thread real_time([&] {
    shapegcode_hal_settings settings{1, 0, {46.0, 0.0, 0.0}, {0.02, 0.0, 0.0}, 0.0, period_s};
    shapegcode_hal_status status{};
    for (int run = 0; !ends; ++run) {
      settings.frequency_hz[0] = 40.0 + run / 100 % 20;
      std::array values{1.0, 2.0};  // at rest: any filter passes it on
      shapegcode_hal_run(&slot, 2, &settings, values.data(), values.data(), &status);
      if (std::abs(values[0] - 1.0) > 1e-12 || std::abs(values[1] - 2.0) > 1e-12) ++wrong;
    }
  });
  int acknowledged = 0;
  const int times = static_cast<int>(trials(1000));
  for (int k = 0; k < times; ++k) {
    REQUIRE(shapegcode_hal_open(&slot, 2, report) == 0);
    // Some while a design is on its way, too.
    if (k % 20 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(25));
    acknowledged += shapegcode_hal_close(&slot) == SHAPEGCODE_HAL_ACKNOWLEDGED ? 1 : 0;
  }
  ends = true;
  real_time.join();
  // On a busy computer the thread may get no processor for 20 ms: then there is no answer in time (985 were seen).
  CHECK(2 * acknowledged >= times);
  CHECK(wrong == 0);
  CHECK(slot.begun == slot.ended);
}

TEST_CASE("linuxcnc slot: closing ends where nothing runs any more, and frees nothing that is in use") {
  shapegcode_hal_slot slot{};
  shapegcode_hal_settings settings{0, 0, {}, {}, 0.0, period_s};
  shapegcode_hal_status status{};
  std::array values{1.0, 2.0};
  REQUIRE(shapegcode_hal_open(&slot, 2, report) == 0);
  CHECK(shapegcode_hal_close(&slot) == SHAPEGCODE_HAL_NOT_RUNNING);  // never run
  REQUIRE(shapegcode_hal_open(&slot, 2, report) == 0);
  shapegcode_hal_run(&slot, 2, &settings, values.data(), values.data(), &status);
  CHECK(shapegcode_hal_close(&slot) == SHAPEGCODE_HAL_NOT_RUNNING);  // no longer
  REQUIRE(shapegcode_hal_open(&slot, 2, report) == 0);
  ++slot.begun;  // as if the thread stood still within a run
  CHECK(shapegcode_hal_close(&slot) == SHAPEGCODE_HAL_IN_USE);
  CHECK(slot.hal == nullptr);
  CHECK(slot.leaving != nullptr);
  ++slot.ended;
  CHECK(shapegcode_hal_close(&slot) == SHAPEGCODE_HAL_NOT_RUNNING);
  CHECK(slot.leaving == nullptr);
  shapegcode_hal_run(&slot, 2, &settings, values.data(), values.data(), &status);  // passed on
  CHECK(values == std::array{1.0, 2.0});
  CHECK(status.possible == 1);
}
