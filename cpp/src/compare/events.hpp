// Private: the effects of a program as a list, for comparison with another program.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "shapegcode/compare.hpp"
#include "shapegcode/path.hpp"

namespace shapegcode::detail {

/// Modes at the start of a cut that no event of their own tells.
struct CutModes {
  int plane = 17;
  int distance = 90;
  int feed_mode = 94;
  int exact_stop = 64;
  int cycle_return = 98;
  friend bool operator==(const CutModes&, const CutModes&) = default;
};

/// A run of cutting moves that nothing else interrupts.
struct Cut {
  std::vector<Segments> pieces;
  CutModes modes;
  Vector3 start_mm = Vector3::Zero();
  Vector3 end_mm = Vector3::Zero();
  double length_mm = 0.0;
  std::size_t moves = 0;
  std::size_t exact_stops = 0;
};

inline constexpr std::size_t no_cut = std::numeric_limits<std::size_t>::max();

/// One thing that a program does.
struct Event {
  ComparedKind kind = ComparedKind::functions;
  bool optional = false;                   ///< in a block with '/'
  std::uint8_t named = 0;                  ///< bit n: a word of the block gives `position_mm[n]`
  std::uint8_t known = 0;                  ///< bit n: `position_mm[n]` counts
  std::uint32_t line = 0;                  ///< of the plain program
  std::string word;                        ///< codes and numbers that are no lengths
  std::array<double, 4> position_mm = {};  ///< X, Y, Z, R; of a dwell seconds
  double feed_mm_per_s = 0.0;              ///< of a drilling cycle
  std::size_t cut = no_cut;                ///< of a cut, and of a shaped rapid
  const ProgramCall* call = nullptr;       ///< that was executed
};

struct Events {
  std::vector<Event> all;
  std::vector<Cut> cuts;
  int units = 21;                ///< G20 or G21 at the first move
  std::uint32_t units_line = 0;  ///< of that move
  std::uint32_t last_line = 0;   ///< the last one that is executed
};

/// What a program does, read from its words and canonical moves; the program must outlive it.
[[nodiscard]] Events read_events(const Program& program, const ComparisonOptions& options);

}  // namespace shapegcode::detail
