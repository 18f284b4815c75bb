#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "program/siemens/block.hpp"

namespace shapegcode::siemens {

/// Of control flow.
struct StructureError {
  std::size_t index = 0;  // of the line, from 0
  std::string message;
};

/// One program: its lines, their blocks, and what belongs together in it.
class ProgramLines {
 public:
  ProgramLines(std::string name, std::string file, std::uint32_t first, std::shared_ptr<const std::string> text,
               std::vector<std::string_view> lines);

  std::string name;         // in capitals, without _N_ and _SPF
  std::string file;         // that holds it
  std::uint32_t first = 1;  // line of the file at which it begins, from 1

  [[nodiscard]] std::size_t size() const { return lines_.size(); }
  [[nodiscard]] std::string_view line(std::size_t index) const { return lines_[index]; }
  /// The block of a line, from 0.
  [[nodiscard]] std::shared_ptr<const Block> block(std::size_t index);

  /// Find what belongs together, once. What is wrong.
  [[nodiscard]] std::optional<StructureError> find_structure();
  /// The next of IF, ELSE and its end, or of a loop and its end.
  [[nodiscard]] std::size_t partner(std::size_t index) const { return structure_[index].partner; }
  /// The start of the structure that a line ends.
  [[nodiscard]] std::size_t start(std::size_t index) const { return structure_[index].start; }

  /// The line to which a jump of a line leads: the nearest in its direction, and not inside of a structure that is not
  /// around the jump; `ordinal` is that of the jump in its block.
  [[nodiscard]] std::optional<std::size_t> target(const Jump& jump, std::size_t index, std::size_t ordinal);
  /// The nearest line before one that has a label.
  [[nodiscard]] std::optional<std::size_t> label_before(const std::string& label, std::size_t index);

 private:
  struct Place {
    std::size_t partner = 0;
    std::size_t start = 0;
    std::size_t end = 0;           // of the structure that begins here
    std::size_t around = nowhere;  // first line of the innermost structure around this line
  };
  static constexpr std::size_t nowhere = std::numeric_limits<std::size_t>::max();

  /// Whether a label or a block number stands at a line.
  [[nodiscard]] bool is_at(std::size_t index, const std::string& target);
  [[nodiscard]] bool is_reached(std::size_t index, std::size_t from) const;
  [[nodiscard]] std::optional<std::size_t> looked_for(const Jump& jump, std::size_t index);
  void find_surroundings();

  std::shared_ptr<const std::string> text_;
  std::vector<std::string_view> lines_;
  std::vector<std::shared_ptr<const Block>> blocks_;
  std::size_t block_count_ = 0;
  std::vector<Place> structure_;  // empty: not yet looked for
  std::unordered_map<std::uint64_t, std::optional<std::size_t>> targets_;
};

/// The programs of a text: one, or several with heads `%_N_NAME_SPF`.
[[nodiscard]] std::vector<std::shared_ptr<ProgramLines>> programs_of_text(std::string_view text,
                                                                          const std::string& file,
                                                                          const std::string& name);

}  // namespace shapegcode::siemens
