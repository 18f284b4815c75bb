// Private: what LinuxCNC's interpreter carries from block to block: modes, position, offsets, tools.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "shapegcode/linuxcnc_program.hpp"

namespace shapegcode::linuxcnc {

inline constexpr double mm_per_inch = 25.4;

/// Per axis X, Y, Z; none: not known.
using Triple = std::array<std::optional<double>, 3>;
inline constexpr Triple no_offset = {0.0, 0.0, 0.0};

/// Drilling cycles that are read, by tenths of their G numbers.
[[nodiscard]] constexpr bool is_cycle(std::int64_t code) noexcept {
  switch (code) {
    case 730:
    case 740:
    case 810:
    case 820:
    case 830:
    case 840:
    case 850:
    case 860:
    case 890:
      return true;
    default:
      return false;
  }
}

/// Modal groups, as tenths of G numbers; what M70 saves.
struct Modes {
  int motion = 800;
  int plane = 170;
  int distance = 900;
  int centres = 911;
  int feed_mode = 940;
  int units = 210;
  int path = 640;
  int system = 1;     ///< 1 ... 9: G54 ... G59.3
  int retract = 990;  ///< LinuxCNC's own at power-on
  double feed = 0.0;
  double speed = 0.0;
  std::int64_t spindle = 5;
  bool mist = false;
  bool flood = false;
};

/// What a row of drilling cycles keeps until it ends.
struct CycleWords {
  std::optional<double> initial;  ///< level at which the row began
  std::optional<double> r;
  std::optional<double> bottom;
  std::optional<double> peck;
  std::optional<double> dwell;
  std::optional<double> entered;  ///< level at which the expanded program's row began, none: it is in none
};

/// Lengths are mm; the position is that of the program's coordinates.
struct State {
  Modes modes;
  Triple position;
  std::array<Triple, 10> work;         ///< offsets of the work coordinate systems, from 1
  Triple g92 = no_offset;              ///< offset of G92 and G52
  bool g52 = false;                    ///< the offset stands in the expanded program as G52
  Triple saved_g92 = no_offset;        ///< what G92.3 restores
  std::optional<double> length = 0.0;  ///< tool length offset of Z that is in force
  std::int64_t length_number = 0;      ///< its H number, 0: none
  std::int64_t tool = 0;               ///< in the spindle
  std::int64_t selected = 0;           ///< by T
  std::map<std::int64_t, double> lengths;
  const LinuxcncToolTable* table = nullptr;
  std::optional<CycleWords> cycle;
  double cycle_dwell = 0.0;  ///< the last P of a cycle, s: G74 and G84 without P take it, even from before G80
  double machine_unit_mm = 1.0;

  /// Length of the program's unit.
  [[nodiscard]] double unit_mm() const noexcept { return modes.units == 200 ? mm_per_inch : 1.0; }
  [[nodiscard]] Triple& offsets(std::int64_t system) { return work[static_cast<std::size_t>(system)]; }

  /// The position where an offset of an axis changes and the machine does not move.
  void shift(std::size_t axis, std::optional<double> before, std::optional<double> after);
  void select_system(int system);
  void set_length(std::optional<double> new_length, std::int64_t number);
};

/// A work coordinate system in FANUC's words.
[[nodiscard]] std::string system_words(std::int64_t system);

}  // namespace shapegcode::linuxcnc
