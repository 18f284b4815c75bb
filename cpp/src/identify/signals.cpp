#include "shapegcode/identify/arma.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <sstream>
#include <string>

#include "base/checks.hpp"
#include "shapegcode/error.hpp"

namespace shapegcode {
namespace {

void check_signal(std::span<const double> values, const char* what, std::size_t record, std::size_t least_samples) {
  std::ostringstream message;
  if (values.size() < least_samples) {
    message << what << " of record " << record << " has " << values.size() << " samples, at least " << least_samples
            << " needed";
    throw Error(ErrorKind::argument, message.str());
  }
  const auto bad = std::ranges::find_if(values, [](double value) { return !std::isfinite(value); });
  if (bad != values.end()) {
    message << what << " of record " << record << " is not finite at sample " << bad - values.begin();
    throw Error(ErrorKind::argument, message.str());
  }
}

}  // namespace

void check_responses(Responses responses, std::size_t least_samples) {
  if (responses.empty()) throw Error(ErrorKind::argument, "no record: at least one is needed");
  for (std::size_t r = 0; r < responses.size(); ++r) check_signal(responses[r], "response", r, least_samples);
}

void check_taps(std::span<const TapSignals> taps, std::size_t least_samples) {
  if (taps.empty()) throw Error(ErrorKind::argument, "no record: at least one is needed");
  for (std::size_t r = 0; r < taps.size(); ++r) {
    const TapSignals& tap = taps[r];
    if (tap.force_n.size() != tap.response.size()) {
      throw Error(ErrorKind::argument, "record " + std::to_string(r) + " has " + std::to_string(tap.force_n.size()) +
                                           " samples of force and " + std::to_string(tap.response.size()) +
                                           " of response: both must be sampled together");
    }
    check_signal(tap.force_n, "force", r, least_samples);
    check_signal(tap.response, "response", r, least_samples);
    if (std::ranges::all_of(tap.force_n, [](double force) { return force == 0.0; })) {
      throw Error(ErrorKind::argument, "force of record " + std::to_string(r) + " is zero throughout");
    }
  }
}

void check_period(double period_s) { require_period(period_s, "time between samples"); }

}  // namespace shapegcode
