#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "write/block_shape.hpp"

namespace shapegcode {

// Moves the ends of fitted blocks to the other neighbouring increment if that reduces the residual of the axes' modes
// (options.modes), and adapts F and R. All points stay within an increment of the exact command; number, kinds and
// periods of the blocks do not change. `covered`: command periods up to the end of the last block; `rests`: ascending
// periods at which the command is at rest.
void round_for_vibration(std::vector<FittedBlock>& blocks, const Eigen::Ref<const Eigen::MatrixXd>& grid_mm,
                         const BlockShape& shape, std::uint32_t covered, std::span<const std::uint32_t> rests,
                         const FitOptions& options);

}  // namespace shapegcode
