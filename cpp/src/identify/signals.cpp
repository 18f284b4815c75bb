#include "identify/signals.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/checks.hpp"
#include "base/refuse.hpp"

namespace shapegcode {
namespace {

using detail::refuse;

void check_signal(std::span<const double> values, const char* what, std::size_t record, std::size_t min_samples) {
  if (values.size() < min_samples) {
    refuse("{} of record {} has {} samples, at least {} needed", what, record, values.size(), min_samples);
  }
  const auto bad = std::ranges::find_if(values, [](double value) { return !std::isfinite(value); });
  if (bad != values.end()) refuse("{} of record {} is not finite at sample {}", what, record, bad - values.begin());
}

}  // namespace

void check_responses(Responses responses, std::size_t min_samples) {
  if (responses.empty()) refuse("no record: at least one is needed");
  for (std::size_t r = 0; r < responses.size(); ++r) check_signal(responses[r], "response", r, min_samples);
}

void check_taps(std::span<const TapSignals> taps, std::size_t min_samples) {
  if (taps.empty()) refuse("no record: at least one is needed");
  for (std::size_t r = 0; r < taps.size(); ++r) {
    const TapSignals& tap = taps[r];
    if (tap.force_n.size() != tap.response.size()) {
      refuse("record {} has {} samples of force and {} of response: both must be sampled together", r,
             tap.force_n.size(), tap.response.size());
    }
    check_signal(tap.force_n, "force", r, min_samples);
    check_signal(tap.response, "response", r, min_samples);
    if (std::ranges::all_of(tap.force_n, [](double force) { return force == 0.0; })) {
      refuse("force of record {} is zero throughout", r);
    }
  }
}

void check_finite(std::span<const double> values, const char* what) {
  const auto bad = std::ranges::find_if(values, [](double value) { return !std::isfinite(value); });
  if (bad != values.end()) refuse("{} is not finite at entry {}", what, bad - values.begin());
}

void check_period(double period_s) { require_period(period_s, "time between samples"); }

}  // namespace shapegcode
