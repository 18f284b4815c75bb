// Private: the programs read together, in one or several files, and the start of each line.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "shapegcode/program.hpp"

namespace shapegcode::detail {

/// A text between its '%' lines.
struct TapeFrame {
  std::size_t begin = 0;          ///< first byte behind the first '%' line
  std::size_t end = 0;            ///< the closing '%'
  std::uint32_t first_line = 1;   ///< line number at `begin`
  bool framed = false;            ///< has its '%' lines
  bool no_start = false;          ///< has the closing one alone
  std::uint32_t unread_line = 0;  ///< first line with text behind the closing '%'; 0: none
};

/// UTF-8's byte-order mark, which some editors put before the first line.
inline constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

/// Finds the frame, behind a byte-order mark. Throws Error(program) on an empty text, a zero byte, a line that ends
/// with CR alone, a '%' at the start without one at the end.
[[nodiscard]] TapeFrame find_frame(const std::string& text);

/// A position in a text: offset of a line's first byte and the line's number.
struct LinePosition {
  std::size_t at = 0;
  std::uint32_t line = 1;
};

/// One program: an O number and its lines.
struct ProgramUnit {
  std::int64_t number = -1;  ///< -1: the text has no O line, or a name; 0: O0000
  std::uint32_t file = 0;
  std::uint32_t folder = 0;  ///< of a memory punch, counted by its "&F=" lines
  std::string folder_name;   ///< as written; of the program behind such a line and those that follow
  std::string name;          ///< "<NAME>" with its brackets; empty: none
  bool called = false;       ///< by another one
  const std::string* text = nullptr;
  LinePosition first;
  std::size_t end = 0;

  /// The next line from `position`, without its line end; `position` moves behind it. False at the end.
  bool next_line(LinePosition& position, std::string_view& line, std::size_t& begin) const noexcept;
  /// The line that carries sequence number N, searched from `from` on, then from the start, as the control does.
  [[nodiscard]] std::optional<LinePosition> find_n(std::int64_t n, std::size_t from);
  /// Behind the END of a loop, searched from `from` on.
  [[nodiscard]] std::optional<LinePosition> behind_end(int loop, const LinePosition& from);

 private:
  void index_numbers();
  void index_ends();

  bool indexed_ = false;
  std::unordered_map<std::int64_t, std::vector<LinePosition>> numbers_;
  bool ends_indexed_ = false;
  std::map<int, std::vector<LinePosition>> ends_;  ///< behind each END of a loop number
};

class ProgramStore {
 public:
  /// Splits a text into its programs. Throws alarm 0073 on an O number given twice in a folder.
  void add(const std::string& text, const TapeFrame& frame, std::uint32_t file);
  /// That of the same file and folder as `from`, if there is one there.
  [[nodiscard]] ProgramUnit* find(std::int64_t number, const ProgramUnit* from = nullptr) const;
  /// Gives the program added last a number; for one that has none of its own.
  ProgramUnit* number_last(std::int64_t number);
  [[nodiscard]] const std::vector<std::unique_ptr<ProgramUnit>>& units() const noexcept { return units_; }

 private:
  void note(ProgramUnit& unit);

  std::vector<std::unique_ptr<ProgramUnit>> units_;
  std::map<std::tuple<std::uint32_t, std::uint32_t, std::int64_t>, ProgramUnit*> placed_;  ///< by file, folder, number
  std::unordered_map<std::int64_t, ProgramUnit*> first_;                                   ///< by number
};

}  // namespace shapegcode::detail
