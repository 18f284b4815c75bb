#include "write/rounding.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>
#include <span>
#include <vector>

#include "fitted_blocks.hpp"
#include "shapegcode/error.hpp"

using namespace shapegcode::tests;
using shapegcode::Error;
using shapegcode::fit_blocks;
using shapegcode::FitOptions;
using shapegcode::FittedBlock;
using shapegcode::FittedKind;
using shapegcode::ModalRounder;
using shapegcode::Mode;
using shapegcode::RoundingEnd;
using shapegcode::RoundingNode;
using shapegcode::Vector3;

namespace {

using State = std::vector<std::complex<double>>;

/// Relative deflection of a base-excited mode, r'' + 2 zeta w r' + w^2 r = -x'', for a command that is linear between
/// samples: the two-term recursion of its exact pulse transfer function, which knows no complex state.
std::vector<double> deflection(const std::vector<double>& command, const Mode& mode, double step_s) {
  const double w = 2.0 * pi * mode.frequency_hz;
  const double wd = w * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio);
  const double r = std::exp(-mode.damping_ratio * w * step_s);
  const double gain = -r * std::sin(wd * step_s) / (wd * step_s) * mode.participation;
  std::vector<double> out(command.size());
  const auto at = [](const std::vector<double>& v, std::ptrdiff_t i, double before) {
    return i < 0 ? before : v[static_cast<std::size_t>(i)];
  };
  for (std::ptrdiff_t i = 0; i < std::ssize(command); ++i) {
    const double x0 = command.front();
    const double second = at(command, i, x0) - 2.0 * at(command, i - 1, x0) + at(command, i - 2, x0);
    out[static_cast<std::size_t>(i)] =
        gain * second + 2.0 * r * std::cos(wd * step_s) * at(out, i - 1, 0.0) - r * r * at(out, i - 2, 0.0);
  }
  return out;
}

/// Amplitude of the vibration at sample `from` of a deflection that is free from there on: read from two samples.
double amplitude(const std::vector<double>& free, std::size_t from, const Mode& mode, double step_s) {
  const double w = 2.0 * pi * mode.frequency_hz;
  const double wd = w * std::sqrt(1.0 - mode.damping_ratio * mode.damping_ratio);
  const double r = std::exp(-mode.damping_ratio * w * step_s);
  const double cosine = free[from];
  const double sine = (free[from + 1] / r - cosine * std::cos(wd * step_s)) / std::sin(wd * step_s);
  return std::hypot(cosine, sine);
}

/// Errors at block borders, linear between them, on a fine grid, and held at the end.
std::vector<double> fine(const std::vector<double>& errors, const std::vector<std::uint32_t>& periods, int per_period,
                         int held) {
  std::vector<double> out{errors.front()};
  for (std::size_t n = 0; n + 1 < errors.size(); ++n) {
    const int steps = static_cast<int>(periods[n]) * per_period;
    for (int i = 1; i <= steps; ++i) out.push_back(errors[n] + (errors[n + 1] - errors[n]) * i / steps);
  }
  out.insert(out.end(), static_cast<std::size_t>(held), errors.back());
  return out;
}

struct Problem {
  std::vector<RoundingNode> nodes;
  State excitation;
};

/// Ends at random places between increments, the last on one.
Problem random_problem(std::size_t count, unsigned seed, const ModalRounder& rounder) {
  std::mt19937_64 generator(seed);
  std::uniform_real_distribution<double> place(-0.5, 0.5);
  Problem problem;
  problem.nodes.resize(count);
  problem.excitation.resize(count * rounder.mode_count());
  double before = 0.0;
  for (std::size_t n = 0; n < count; ++n) {
    RoundingNode& node = problem.nodes[n];
    node.error = n + 1 < count ? place(generator) : 0.0;
    node.other = n + 1 == count ? std::int8_t{0} : node.error < 0.0 ? std::int8_t{1} : std::int8_t{-1};
    rounder.advance(std::span(&problem.excitation[n * rounder.mode_count()], rounder.mode_count()),
                    node.error - before);
    before = node.error;
  }
  return problem;
}

/// Amplitude that a choice leaves, all modes added up, by the recursion above.
double left_by(const Problem& problem, const std::vector<std::int8_t>& shift, const std::vector<Mode>& modes,
               double period_s) {
  std::vector<double> errors{0.0};
  for (std::size_t n = 0; n < shift.size(); ++n) errors.push_back(problem.nodes[n].error + shift[n]);
  const std::vector<std::uint32_t> periods(shift.size(), 1);
  const std::vector<double> command = fine(errors, periods, 4, 4);
  double squares = 0.0;
  for (const Mode& mode : modes) {
    const auto free = deflection(command, mode, 0.25 * period_s);
    squares += std::pow(amplitude(free, free.size() - 3, mode, 0.25 * period_s), 2);
  }
  return std::sqrt(squares);
}

const std::vector<Mode> two_modes{{46.0, 0.02, 1.0}, {131.0, 0.02, 0.4}};

}  // namespace

TEST_CASE("rounding: the modal state is that of the mode's differential equation") {
  const double period_s = 0.002;
  for (const Mode& mode : {Mode{46.0, 0.02, 1.0}, Mode{131.0, 0.0, 0.7}, Mode{310.0, 0.3, 1.0}}) {
    const ModalRounder rounder(std::span(&mode, 1), period_s, 2);
    State state(1);
    std::vector<double> errors{0.0};
    std::mt19937_64 generator(3);
    std::uniform_real_distribution<double> place(-1.0, 1.0);
    for (int k = 0; k < 60; ++k) {
      errors.push_back(k + 1 < 60 ? place(generator) : 0.0);
      rounder.advance(state, errors.back() - errors[errors.size() - 2]);
    }
    const std::vector<double> command = fine(errors, std::vector<std::uint32_t>(60, 1), 5, 10);
    const auto free = deflection(command, mode, period_s / 5);
    // The recursion gives the deflection one step late where slopes change; at rest it is free.
    CHECK(std::abs(state[0]) == doctest::Approx(amplitude(free, 60 * 5, mode, period_s / 5)).epsilon(1e-9));
  }
}

TEST_CASE("rounding: a curved period is a parabola joined between ticks") {
  const double period_s = 0.005;
  const Mode mode{46.0, 0.02, 1.0};
  for (const int ticks : {1, 2, 5, 10}) {
    const ModalRounder rounder(std::span(&mode, 1), period_s, ticks);
    State state(1);
    rounder.bulge(state, 3.0);
    std::vector<double> errors;
    for (int i = 0; i <= ticks; ++i) errors.push_back(12.0 * i / ticks * (1.0 - static_cast<double>(i) / ticks));
    const double step_s = period_s / ticks / 4;
    const auto free =
        deflection(fine(errors, std::vector<std::uint32_t>(static_cast<std::size_t>(ticks), 1), 4, 10), mode, step_s);
    CHECK(std::abs(state[0]) ==
          doctest::Approx(amplitude(free, static_cast<std::size_t>(ticks) * 4, mode, step_s)).epsilon(1e-9));
  }
}

TEST_CASE("rounding: with few ends the choice before a rest is the best of all") {
  for (const std::size_t count : {2U, 5U, 8U}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      ModalRounder rounder(two_modes, 0.005, 5);
      const Problem problem = random_problem(count, seed, rounder);
      std::vector<std::int8_t> shift(count);
      rounder.choose(problem.nodes, problem.excitation, {true, {}, 0, {}}, shift);
      double least = std::numeric_limits<double>::infinity();
      for (unsigned choice = 0; choice < 1U << (count - 1); ++choice) {
        std::vector<std::int8_t> other(count);
        for (std::size_t n = 0; n < count; ++n) {
          other[n] = (choice >> n & 1U) != 0 ? problem.nodes[n].other : std::int8_t{0};
        }
        least = std::min(least, left_by(problem, other, two_modes, 0.005));
      }
      CHECK(left_by(problem, shift, two_modes, 0.005) == doctest::Approx(least).epsilon(1e-9));
    }
  }
}

TEST_CASE("rounding: long runs end far quieter, and state goes on over sections") {
  std::vector<double> ratios;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    ModalRounder rounder(two_modes, 0.002, 2);
    const Problem problem = random_problem(300, seed, rounder);
    std::vector<std::int8_t> shift(300);
    // In two sections: the first ends on its nearest increment, as every section does.
    Problem split = problem;
    split.nodes[149].other = 0;
    const std::span<const RoundingNode> nodes(split.nodes);
    const std::span<const std::complex<double>> excitation(split.excitation);
    rounder.choose(nodes.first(150), excitation.first(300), {}, std::span(shift).first(150));
    rounder.accept();
    rounder.choose(nodes.subspan(150), excitation.subspan(300), {true, {}, 0, {}}, std::span(shift).subspan(150));
    CHECK(shift[149] == 0);
    for (std::size_t n = 0; n < shift.size(); ++n) {
      CHECK(std::abs(problem.nodes[n].error + shift[n]) < 1.0);
      CHECK((shift[n] == 0 || shift[n] == problem.nodes[n].other));
    }
    const std::vector<std::int8_t> nearest(300);
    ratios.push_back(left_by(problem, shift, two_modes, 0.002) / left_by(problem, nearest, two_modes, 0.002));
  }
  std::nth_element(ratios.begin(), ratios.begin() + 20, ratios.end());
  CHECK(ratios[20] < 0.25);
}

TEST_CASE("rounding: ends that do not go together are not chosen") {
  std::mt19937_64 generator(5);
  for (unsigned seed = 1; seed <= 20; ++seed) {
    ModalRounder rounder(two_modes, 0.005, 5);
    Problem problem = random_problem(200, seed, rounder);
    for (RoundingNode& node : problem.nodes) node.allowed = static_cast<std::uint8_t>(1U | generator() % 16);
    std::vector<std::int8_t> shift(200);
    rounder.choose(problem.nodes, problem.excitation, {true, {}, 0, {}}, shift);
    unsigned from = 0;
    int wrong = 0;
    for (std::size_t n = 0; n < shift.size(); ++n) {
      const unsigned to = shift[n] != 0 ? 1 : 0;
      if ((problem.nodes[n].allowed >> (2 * from + to) & 1U) == 0) ++wrong;
      from = to;
    }
    CHECK(wrong == 0);
  }
}

TEST_CASE("rounding: what is known to come late is met") {
  // A state of half an increment that shows at the end only is brought down like any other.
  ModalRounder rounder(two_modes, 0.005, 5);
  double before = 0.0;
  double after = 0.0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Problem problem = random_problem(100, seed, rounder);
    const State late{{0.5, 0.1}, {-0.1, 0.3}};
    for (const bool known : {false, true}) {
      ModalRounder fresh(two_modes, 0.005, 5);
      std::vector<std::int8_t> shift(100);
      fresh.choose(problem.nodes, problem.excitation,
                   {true, known ? std::span(late) : std::span<const std::complex<double>>{}, 0, {}}, shift);
      State state = late;
      State own(2);
      double error = 0.0;
      for (std::size_t n = 0; n < shift.size(); ++n) {
        const double next = problem.nodes[n].error + shift[n];
        fresh.advance(own, next - error);
        error = next;
      }
      (known ? after : before) += std::hypot(std::abs(state[0] + own[0]), std::abs(state[1] + own[1]));
    }
  }
  CHECK(after < 0.6 * before);
}

TEST_CASE("rounding: refuses what is no mode, no period and no tick") {
  const Mode none{0.0, 0.02, 1.0};
  CHECK_THROWS_AS(ModalRounder(std::span(&none, 1), 0.005, 5), Error);
  CHECK_THROWS_AS(ModalRounder(two_modes, 0.0, 5), Error);
  CHECK_THROWS_AS(ModalRounder(two_modes, std::numeric_limits<double>::quiet_NaN(), 5), Error);
  CHECK_THROWS_AS(ModalRounder(two_modes, 0.005, 0), Error);
}

// --- Fitted blocks
// -------------------------------------------------------------------------------------------------------------

namespace {

FitOptions with_modes(double increment, double period_s = 0.005) {
  FitOptions options;
  options.increment_mm = increment;
  options.block_period_s = period_s;
  options.modes = {std::vector<Mode>{{46.0, 0.02, 1.0}}, std::vector<Mode>{{131.0, 0.02, 1.0}}, {}};
  return options;
}

/// Amplitude of an axis' vibration behind the last block, in mm: blocks simulated tick by tick against the command,
/// which is linear between its samples.
double left_by_blocks(const Command& command, const std::vector<FittedBlock>& blocks, const FitOptions& options,
                      Eigen::Index axis, const Mode& mode) {
  const int ticks = static_cast<int>(std::lround(options.block_period_s / options.interpolation_period_s));
  std::vector<double> error{0.0};
  Position from = rounded(command, 0, options.increment_mm);
  error[0] = to_mm(from, options.increment_mm)[axis] - command.grid(0, axis);
  std::size_t tick = 0;
  const auto exact = [&](std::size_t t) {
    const auto k = static_cast<Eigen::Index>(t) / ticks;
    if (k + 1 >= command.grid.rows()) return command.grid(command.grid.rows() - 1, axis);
    const double fraction = static_cast<double>(t % static_cast<std::size_t>(ticks)) / ticks;
    return command.grid(k, axis) + fraction * (command.grid(k + 1, axis) - command.grid(k, axis));
  };
  for (const FittedBlock& block : blocks) {
    const Simulated simulated = as_simulated(from, block, options.increment_mm);
    const int steps = static_cast<int>(block.periods) * ticks;
    for (int i = 1; i <= steps; ++i) {
      error.push_back(simulated.at(static_cast<double>(i) / steps)[axis] - exact(++tick));
    }
    from = block.end;
  }
  const double last = to_mm(from, options.increment_mm)[axis];
  while (tick < static_cast<std::size_t>(command.middle.rows()) * static_cast<std::size_t>(ticks)) {
    error.push_back(last - exact(++tick));
  }
  const std::size_t rest = error.size() - 1;
  error.insert(error.end(), 8, error.back());
  // Finer than the ticks, so that no mode is near the sampling rate.
  const std::vector<double> command_error = fine(error, std::vector<std::uint32_t>(error.size() - 1, 1), 4, 0);
  const double step_s = 0.25 * options.interpolation_period_s;
  return amplitude(deflection(command_error, mode, step_s), 4 * rest + 1, mode, step_s);
}

}  // namespace

TEST_CASE("rounding: fitted blocks keep time and place, stay within an increment and leave less") {
  int seed = 100;
  for (const double increment : {0.001, 0.00254, 0.0001}) {
    for (const double speed : {0.5, 0.05, 0.002}) {
      for (const int steady_for : {1, 40}) {
        std::array<std::vector<double>, 2> before;
        std::array<std::vector<double>, 2> after;
        for (int run = 0; run < 9; ++run) {
          const Command command = random_command(400, static_cast<unsigned>(++seed), speed, steady_for);
          const FitOptions options = with_modes(increment);
          FitOptions plain = options;
          plain.modes = {};
          const auto nearest = fit(command, plain);
          const auto blocks = fit(command, options);
          const Findings found = judge(command, blocks, options);
          const Findings plainly = judge(command, nearest, plain);
          CAPTURE(increment);
          CAPTURE(speed);
          CAPTURE(steady_for);
          CHECK(found.empty == 0);
          CHECK(found.wrong_ticks == 0);
          CHECK(found.late == 0);
          CHECK(found.reversals == 0);
          CHECK(found.end_error < 1.0);
          CHECK(found.inside_error <= std::max(1.0, plainly.inside_error + 1e-9));
          REQUIRE(blocks.size() == nearest.size());
          CHECK(blocks.back().end == nearest.back().end);
          int different = 0;
          for (std::size_t n = 0; n < blocks.size(); ++n) {
            if (blocks[n].periods != nearest[n].periods || blocks[n].first_period != nearest[n].first_period ||
                blocks[n].end[2] != nearest[n].end[2]) {
              ++different;  // Z has no mode
            }
          }
          CHECK(different == 0);
          for (std::size_t axis = 0; axis < 2; ++axis) {
            const auto i = static_cast<Eigen::Index>(axis);
            const Mode mode = options.modes[axis][0];
            before[axis].push_back(left_by_blocks(command, nearest, options, i, mode));
            after[axis].push_back(left_by_blocks(command, blocks, options, i, mode));
          }
        }
        for (std::size_t axis = 0; axis < 2; ++axis) {
          std::nth_element(before[axis].begin(), before[axis].begin() + 4, before[axis].end());
          std::nth_element(after[axis].begin(), after[axis].begin() + 4, after[axis].end());
          CAPTURE(axis);
          // A slow command has few ends to choose.
          CHECK(after[axis][4] < before[axis][4] / (speed > 0.01 ? 3.0 : 1.0));
        }
      }
    }
  }
}

TEST_CASE("rounding: arcs keep their sense, follow the circle and leave less, whatever their bulge") {
  double before = 0.0;
  double after = 0.0;
  for (const double radius : {2.0, 20.0}) {
    for (const double sense : {1.0, -1.0}) {
      // A third of a turn, started and stopped without a jerk.
      const auto angle = [&](double k) {
        const double u = std::clamp(k / 150.0, 0.0, 1.0);
        return sense * 2.0 * (u - std::sin(2.0 * pi * u) / (2.0 * pi));
      };
      const Command command = sampled(
          150,
          [&](double k) {
            return Vector3(1.2345 + radius * std::cos(angle(k)), -0.5 + radius * std::sin(angle(k)), 0.3333);
          },
          2);
      // Small increments: the bulge of an arc is many of them.
      const FitOptions options = with_modes(0.0001);
      FitOptions plain = options;
      plain.modes = {};
      const auto nearest = fit(command, plain);
      const auto blocks = fit(command, options);
      for (const Eigen::Index axis : {0, 1}) {
        const Mode mode = options.modes[static_cast<std::size_t>(axis)][0];
        before += left_by_blocks(command, nearest, options, axis, mode);
        after += left_by_blocks(command, blocks, options, axis, mode);
      }
      const Findings found = judge(command, blocks, options);
      REQUIRE(blocks.size() == nearest.size());
      CHECK(found.arcs == judge(command, nearest, plain).arcs);
      CHECK(found.arcs > 10);
      CHECK(found.empty + found.wrong_ticks + found.late + found.bad_sweep + found.reversals == 0);
      CHECK(found.end_error < 1.0);
      for (std::size_t n = 0; n < blocks.size(); ++n) {
        CHECK(blocks[n].kind == nearest[n].kind);
        CHECK(blocks[n].end[2] == 3333);
      }
      double off = 0.0;
      Position from = rounded(command, 0, options.increment_mm);
      for (const FittedBlock& block : blocks) {
        const Simulated simulated = as_simulated(from, block, options.increment_mm);
        for (int i = 0; i <= 10; ++i) {
          Vector3 p = simulated.at(i / 10.0) - Vector3(1.2345, -0.5, 0.3333);
          off = std::max(off, std::abs(std::hypot(p[0], p[1]) - radius));
        }
        from = block.end;
      }
      CHECK(off < 0.00024);  // an increment per axis, and what the fit allows the middle
    }
  }
  CHECK(after < 0.07 * before);  // 0.05; without what the bulge leaves 0.1
}

TEST_CASE("rounding: a slow axis alone makes no empty block and does not turn back") {
  for (const double step : {0.0003, 0.0006, 0.0011, 0.0017}) {
    const Command command =
        sampled(300, [&](double k) { return Vector3(0.0004 + step * (k + 0.3 * std::sin(k * k)), 1.0, 2.0); });
    FitOptions options = with_modes(0.001);
    options.merge_tolerance_increments = 0.0;  // so that the ends lie close
    const Findings found = judge(command, fit(command, options), options);
    CHECK(found.empty + found.wrong_ticks + found.late + found.reversals == 0);
    CHECK(found.end_error < 1.0);
  }
}

TEST_CASE("rounding: blocks of minutes are nothing special") {
  const Command command = sampled(8000, [](double k) { return Vector3(0.00000833 * k, 0.0, 0.0); });
  for (const int normal : {-1, 2}) {
    Command with_plane = command;
    with_plane.normals.assign(with_plane.normals.size(), static_cast<std::int8_t>(normal));
    const FitOptions options = with_modes(0.0001);
    const Findings found = judge(with_plane, fit(with_plane, options), options);
    CHECK(found.empty + found.wrong_ticks + found.late + found.reversals == 0);
    // The judge takes the last block's periods for its command's, but some of its time was lent.
    FitOptions plain = options;
    plain.modes = {};
    CHECK(found.end_error <= std::max(1.0, judge(with_plane, fit(with_plane, plain), plain).end_error));
  }
  ModalRounder rounder(two_modes, 0.005, 5);
  Problem problem = random_problem(20, 1, rounder);
  for (RoundingNode& node : problem.nodes) node.periods = 8000;
  const State late{{0.5, 0.1}, {-0.1, 0.3}};
  std::vector<std::int8_t> shift(20);
  rounder.choose(problem.nodes, problem.excitation, {true, late, 0, {}}, shift);
  for (std::size_t n = 0; n < shift.size(); ++n) CHECK(std::abs(problem.nodes[n].error + shift[n]) < 1.0);
}

TEST_CASE("rounding: at a rest on the way the blocks are on the nearest increment, and a resting axis stays") {
  // There and, after a pause, on; Y rests off an increment all the time.
  const auto at = [](double k) {
    const auto move = [](double u) {
      return std::clamp(u, 0.0, 1.0) - std::sin(2.0 * pi * std::clamp(u, 0.0, 1.0)) / (2.0 * pi);
    };
    return Vector3(7.0003 * move(k / 60.0) + 5.0 * move((k - 70.0) / 60.0), 0.1234567, 0.0);
  };
  const Command command = sampled(130, at);
  const FitOptions options = with_modes(0.001);
  const std::vector<std::uint32_t> breaks{70, 130};
  const std::vector<std::uint32_t> rests{70};
  const auto blocks = fit_blocks(command.grid, command.middle, command.normals, {breaks, rests}, options);
  bool found = false;
  int moved = 0;
  for (const FittedBlock& block : blocks) {
    if (block.end[1] != 123) ++moved;
    found = found || block.end[0] == 7000;
  }
  CHECK(moved == 0);
  CHECK(found);
  const Findings findings = judge(command, blocks, options);
  CHECK(findings.empty + findings.wrong_ticks + findings.late + findings.reversals == 0);
  CHECK(findings.end_error < 1.0);
}
