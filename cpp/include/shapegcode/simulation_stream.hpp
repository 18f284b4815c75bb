#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/fanuc_model.hpp"
#include "shapegcode/program.hpp"
#include "shapegcode/simulation.hpp"
#include "shapegcode/timing.hpp"

namespace shapegcode {

/// A section of a simulated motion, one row per interpolation period.
struct SimulationChunk {
  std::uint64_t first_sample = 0;  ///< its time is first_sample * period
  Eigen::MatrixXd command_mm;      ///< set-points after every filter, (k, 3)
  Eigen::MatrixXd response_mm;     ///< (k, 3)
  /// Of the command over the period that ends with the row, (k, 3), without jumps of coordinates; 0 at the start.
  Eigen::MatrixXd velocity_mm_per_s;
  /// Feed drives only, otherwise without rows: motor position as table travel, motor force, friction of the table, (k,
  /// 3).
  Eigen::MatrixXd motor_mm;
  Eigen::MatrixXd motor_force_n;
  Eigen::MatrixXd friction_force_n;
  std::vector<std::uint32_t> line;  ///< of the present block
  std::vector<BlockKind> kind;      ///< of that block

  [[nodiscard]] std::size_t size() const noexcept { return line.size(); }
};

/// Simulates a motion through filters and plant and returns it in pieces. Memory does not grow with its length (a
/// program needs that of its longest region). Of the options it uses period, filters and plant; for a program the
/// filters are those of its controller.
class SimulationStream {
 public:
  /// A path under a speed profile (a controller with look-ahead). `rest_s`: time at rest after the end. Throws
  /// Error(argument) on an invalid plant or period, or rest_s < 0.
  SimulationStream(std::shared_ptr<const Path> path, std::shared_ptr<const SpeedProfile> profile,
                   const SimulationOptions& options, double rest_s = 0.0);
  /// Blocks at their feed (a controller without look-ahead). Also throws Error(argument) on blocks that
  /// BlockInterpolator refuses.
  SimulationStream(std::shared_ptr<const Path> blocks, BlockEnd block_end, double override_ratio,
                   const SimulationOptions& options, double rest_s = 0.0);
  /// A whole program on one time axis, as in interpolate_program: regions, other cutting moves, rapids, waits for
  /// in-position, dwells, tool changes and M codes. The plant is simulated continuously. Where the coordinates jump
  /// without motion (work offset, tool length, an axis of unknown position), command and plant jump together.
  /// `region_offsets_mm`: from the positions of each region to machine positions, for modes that vary with them; empty:
  /// zero. Also throws Error(argument) on a model that `check` refuses, options with another period than its, or not
  /// one offset per region.
  SimulationStream(std::shared_ptr<const Program> program, const FanucModel& model, const SimulationOptions& options,
                   std::vector<Vector3> region_offsets_mm = {}, double rest_s = 0.0);
  ~SimulationStream();
  SimulationStream(SimulationStream&&) noexcept;
  SimulationStream& operator=(SimulationStream&&) noexcept;

  /// The next rows, at most `most`; none after the end. Throws Error(argument) on a block of a program without a feed,
  /// Error(numeric) if the integrator of a drive fails.
  [[nodiscard]] SimulationChunk read(std::size_t most);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Rows of a CSV file with LF: a word, a comma, and the numbers of the table's row, each as the shortest text that
/// reads back as the same number. `word` has the index of each row's word in `words`. Throws Error(argument) if its
/// size differs from the rows of the table, or on an index without a word.
[[nodiscard]] std::string csv_rows(std::span<const std::uint8_t> word, const std::vector<std::string>& words,
                                   const Eigen::Ref<const Eigen::MatrixXd>& table);

}  // namespace shapegcode
