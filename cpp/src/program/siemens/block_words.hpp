#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "program/siemens/block.hpp"
#include "program/siemens/path.hpp"

namespace shapegcode::siemens {

class Run;

/// What ends a program.
enum class End : std::uint8_t { none, m17, m2, m30 };

/// Executes blocks of words. Codes and their groups as PyPI nc-gcode-interpreter lists them; G70 to G710 easymanua.ls
/// 592300 p. 139; G53, G153, SUPA, G500 679150 p. 100; D number i5cnc.com 126.
class BlockWords {
 public:
  BlockWords(SiemensPath& path, Run& run, bool uses_m6) : path_(path), run_(run), uses_m6_(uses_m6) {}

  /// A comment of a block, as far as FANUC's may hold it.
  void comment(std::string_view text);
  /// Whether a bare word may be the name of a program.
  [[nodiscard]] bool may_be_call(const Word& word) const;
  /// What was in force before a subprogram with SAVE.
  void restore(const Modes& modes);
  /// One block; says which word ends the program.
  End execute(const Block& block);

 private:
  using Words = std::vector<Word>;
  using Functions = std::vector<const Word*>;
  using Rotary = std::vector<std::pair<char, double>>;

  /// An address twice (alarm 12010), and the words that exclude each other.
  void refuse_twice(const Words& words) const;
  void refuse_groups(const Block& block) const;
  /// A block that begins with a frame, or holds a code or call that stands alone; false: it is none.
  bool own_block(const Block& block);
  End moves(const Block& block);

  [[nodiscard]] Value value(const Word& word) const;
  [[nodiscard]] double number_of_word(const Word& word) const;
  [[nodiscard]] double length(const Word& word) const;
  [[nodiscard]] bool is_incremental(const Word& word) const;
  [[nodiscard]] std::int64_t whole_of(const Word& word) const;

  /// A word of a mode, or G9; false: another one.
  bool mode(const Word& word, Given& given);
  /// A word without a value.
  void code(const Word& word, Given& given);
  void path_mode(WordId id);
  [[nodiscard]] Error refusal(const Word& word) const;
  /// A word with a value.
  void address(const Word& word, Given& given, Rotary& rotary, Functions& functions);
  void centre(const Word& word, Given& given) const;
  void round_word(const Word& word, Given& given) const;
  void polar_word(const Word& word, Mode mode, Given& given) const;
  void feed(const Word& word, Given& given);

  void go(Given& given, const Rotary& rotary, const std::string& own_frame);
  /// G53, G153 or SUPA: a rapid in machine coordinates.
  void in_machine(const Given& given, const std::string& code);

  /// Functions that come before the motion of their block; gives the M codes that come behind it.
  std::vector<std::int64_t> before(const Functions& functions);
  void function(const Word& word, std::vector<std::int64_t>& codes);
  void spindle(const Word& word);
  void select_tool(const Word& word);
  void change_tool();
  void edge(const Word& word, bool changes);
  /// The length offset of an edge of the tool.
  void offset(std::int64_t edge, std::uint32_t column);
  /// The number of the tool for its first edge, one from 801 for others: FANUC's offsets end with 999.
  std::int64_t offset_number(std::int64_t edge);

  /// TRANS and its relatives.
  void frame(const Words& words);
  void special(const Word& word, const Words& words);
  void pole(const Word& first, const Word& code, std::span<const Word* const> others);
  void dwell(std::span<const Word* const> others);
  /// G74 to the reference point, G75 to a fixed one: where the axes are then only the control knows.
  void reference(const Word& code, std::span<const Word* const> others);
  void call(const Word& word, bool is_alone);

  SiemensPath& path_;
  Run& run_;
  bool uses_m6_;
  std::int64_t tool_ = 0;
  std::int64_t next_tool_ = 0;
  std::int64_t edge_ = -1;
  std::int64_t next_edge_ = -1;
  std::unordered_map<std::string, std::int64_t> tools_;
  std::map<std::pair<std::int64_t, std::int64_t>, std::int64_t> offsets_;  // by tool and edge
  double spindle_ = std::numeric_limits<double>::quiet_NaN();              // 1/min
  std::string_view path_mode_;
};

}  // namespace shapegcode::siemens
