// Private: LinuxCNC's G and M codes: their groups, which words they use, and which of them are not read. Held against
// rs274 2.9, which refuses a block with a word that none of its codes uses.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "program/linuxcnc/interpreter_state.hpp"
#include "program/linuxcnc/word_values.hpp"

namespace shapegcode::linuxcnc {

enum class Group : std::uint8_t {
  motion,
  one_shot,
  dwell,
  machine,
  plane,
  distance,
  centres,
  feed,
  units,
  compensation,
  length,
  path,
  retract,
  spindle,
  lathe,
  system,
};

/// The G codes of a block, in tenths, by their groups.
class GroupCodes {
 public:
  [[nodiscard]] std::optional<int> get(Group group) const noexcept {
    const int code = codes_[static_cast<std::size_t>(group)];
    return code < 0 ? std::nullopt : std::optional(code);
  }
  [[nodiscard]] bool has(Group group) const noexcept { return get(group).has_value(); }
  void set(Group group, int code) noexcept { codes_[static_cast<std::size_t>(group)] = code; }

  template <class Predicate>
  [[nodiscard]] bool any(const Predicate& holds) const {
    for (const int code : codes_) {
      if (code >= 0 && holds(code)) return true;
    }
    return false;
  }

 private:
  std::array<int, 16> codes_ = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
};

/// A block whose values are worked out.
struct BlockWords {
  std::vector<std::pair<char, double>> words;
  std::vector<std::int64_t> codes;      ///< G codes in tenths
  std::vector<std::int64_t> functions;  ///< M codes
  WordValues values;                    ///< the others

  /// Sorts the words.
  void sort();
};

/// A G code of tenths.
[[nodiscard]] std::string code_text(std::int64_t code);

/// The G codes of a block by their groups; what is not read is refused.
[[nodiscard]] GroupCodes by_group_of(const BlockWords& block);

/// Words that no code of the block uses, as LinuxCNC refuses them: X1e3 is X1 and E3, not 1000.
void refuse_unused(const Modes& modes, const GroupCodes& codes, const BlockWords& block);

/// 1 ... 9 of G54 ... G59.3.
[[nodiscard]] int system_of(int code) noexcept;

}  // namespace shapegcode::linuxcnc
