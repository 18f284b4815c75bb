#include "command/run_shaper.hpp"

#include <utility>

namespace shapegcode {

RunShaper::RunShaper(std::shared_ptr<const Path> path, std::shared_ptr<const RunMotion> motion, const RunFilter& filter,
                     const RunLimits& limits, RunDeviation* measured)
    : rows_(std::move(path), std::move(motion), filter, measured != nullptr) {
  if (filter.target != ContourTarget::none) {
    corrector_.emplace(rows_, limits);
  }
  if (measured != nullptr) {
    meter_.emplace(rows_, *measured);
  }
}

void RunShaper::next(Vector3& position) {
  const std::size_t needed = out_ + (meter_ ? 2 : 1);
  if (corrector_) {
    corrector_->decide_to(needed);
  } else {
    rows_.read_to(needed);
  }
  if (meter_) {
    meter_->measure(out_);
    position = meter_->shaped();
  } else {
    position = rows_.shaped(static_cast<std::ptrdiff_t>(out_), corrector_.has_value());
  }
  ++out_;
  rows_.forget(out_);
}

// A correction changes the command slightly before the start and after the end of an arc.
std::int8_t RunShaper::arc_normal() { return rows_.arc_normal(out_ - 1, corrector_ ? corrector_->lead() : 0); }

}  // namespace shapegcode
