#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>

#include "command/run_corrector.hpp"
#include "command/run_deviation.hpp"
#include "command/run_filter.hpp"
#include "command/run_reader.hpp"

namespace shapegcode {

/// One motion from rest to rest as a shaped command on half the block grid: row 2k is boundary k of the block periods,
/// row 2k+1 the middle of period k. With a target, the command before shaping is corrected so that the shaped command
/// or the response stays on the path.
class RunShaper {
 public:
  /// `filter` stays the caller's. `measured`: filled while the run is given out if not null; asks for a target.
  RunShaper(std::shared_ptr<const Path> path, std::shared_ptr<const RunMotion> motion, const RunFilter& filter,
            const RunLimits& limits, RunDeviation* measured = nullptr);
  // The corrector and the meter look into the rows beside them.
  RunShaper(const RunShaper&) = delete;
  RunShaper& operator=(const RunShaper&) = delete;
  ~RunShaper() = default;

  /// Whole block periods of the shaped run.
  [[nodiscard]] std::uint32_t periods() const noexcept { return rows_.periods(); }
  /// Next row of the shaped command; call 2*periods()+1 times.
  void next(Vector3& position);
  /// Axis across the plane of an arc that the command follows in the period that begins at the row last given, or -1.
  [[nodiscard]] std::int8_t arc_normal();

 private:
  RunReader rows_;
  std::optional<RunCorrector> corrector_;
  std::optional<DeviationMeter> meter_;
  std::size_t out_ = 0;  // rows given out
};

}  // namespace shapegcode
