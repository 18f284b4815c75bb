#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "shapegcode/mode.hpp"

namespace shapegcode {

/// ModalPlant with constant modes for whole records: the same motion to the last bit (but for deflections below 1e-290,
/// which count as none), without peaks between samples, any number of axes, and about as fast as memory can be read.
/// Records may be handed over in pieces.
class ModalResponse {
 public:
  /// (n_samples, n_axes) in any memory order, mm.
  using Record = Eigen::Ref<const Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;
  using Result = Eigen::Ref<Eigen::MatrixXd, 0, Eigen::Stride<Eigen::Dynamic, Eigen::Dynamic>>;

  /// `modes`: by axis; an axis without modes follows its command. Throws Error(argument) on period_s <= 0, an invalid
  /// mode or no axis.
  ModalResponse(const std::vector<std::vector<Mode>>& modes, double period_s);
  ~ModalResponse();
  ModalResponse(ModalResponse&&) noexcept;
  ModalResponse& operator=(ModalResponse&&) noexcept;
  ModalResponse(const ModalResponse&) = delete;
  ModalResponse& operator=(const ModalResponse&) = delete;

  /// Response at each row of the next piece of a record, in the units of the command. At the first row of the first
  /// piece the plant is at rest. `response` has the shape of `command`, and may be the command itself. Throws
  /// Error(argument) on another shape or a value that is not finite (not to be continued then).
  void apply(const Record& command, Result response);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The response of base-excited modes to a record of set-points that is linear between them (ModalResponse), at rest
/// at the first row. Throws as ModalResponse and its apply().
[[nodiscard]] Eigen::MatrixXd plant_response(const ModalResponse::Record& command,
                                             const std::vector<std::vector<Mode>>& modes, double period_s);

}  // namespace shapegcode
