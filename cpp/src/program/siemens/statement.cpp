// Statements of control flow and definitions.
#include <fmt/format.h>

#include <array>
#include <utility>

#include "program/siemens/block.hpp"

namespace shapegcode::siemens {
namespace {

constexpr std::array<std::pair<std::string_view, BlockKind>, 6> bare_words = {{{"ELSE", BlockKind::else_begins},
                                                                               {"ENDIF", BlockKind::if_ends},
                                                                               {"ENDWHILE", BlockKind::while_ends},
                                                                               {"ENDFOR", BlockKind::for_ends},
                                                                               {"LOOP", BlockKind::loop_begins},
                                                                               {"ENDLOOP", BlockKind::loop_ends}}};

constexpr std::array<std::pair<std::string_view, JumpKind>, 4> jump_words = {{{"GOTOF", JumpKind::forward},
                                                                              {"GOTOB", JumpKind::backward},
                                                                              {"GOTOC", JumpKind::quiet},
                                                                              {"GOTO", JumpKind::either_way}}};

constexpr std::array<std::string_view, 7> synchronous_words = {"ID", "IDS", "WHEN", "WHENEVER", "FROM", "EVERY", "DO"};

constexpr std::string_view end_of_block = "the end of the block";

class StatementReader {
 public:
  StatementReader(Scanner& scan, Block& block) : scan_(scan), block_(block) {}

  bool read(std::string_view name) {
    for (const auto& [word, kind] : bare_words) {
      if (word == name) return is(kind, name);
    }
    for (const auto& [word, kind] : jump_words) {
      if (word != name) continue;
      block_.kind = BlockKind::jumps;
      jumps({});
      return true;
    }
    if (name == "WHILE" || name == "UNTIL") {
      is(name == "WHILE" ? BlockKind::while_begins : BlockKind::until, name);
      block_.condition = expression();
      return true;
    }
    if (name == "IF") return is(BlockKind::if_begins, name) && condition();
    if (name == "DEF") return is(BlockKind::definitions, name) && definitions();
    if (name == "CASE") return is(BlockKind::choice, name) && choice();
    if (name == "FOR") return is(BlockKind::for_begins, name) && counted();
    if (name == "REPEAT") return is(BlockKind::repeat_begins, name) && repeat();
    if (name == "PROC") return is(BlockKind::procedure, name) && procedure();
    return rest_of_line(name);
  }

 private:
  bool is(BlockKind kind, std::string_view name) {
    block_.kind = kind;
    scan_.go_to(scan_.at() + name.size());
    return true;
  }

  Expression expression() { return read_expression(scan_, block_.pool); }

  /// EXTERN and synchronous actions: what stands behind them is not read.
  bool rest_of_line(std::string_view name) {
    const std::uint32_t column = scan_.column();
    if (name == "EXTERN") {
      block_.kind = BlockKind::external;
    } else {
      bool is_synchronous = false;
      for (const std::string_view each : synchronous_words) is_synchronous |= each == name;
      if (!is_synchronous) return false;
      Word word;
      word.name = name;
      word.column = column;
      block_.words.push_back(std::move(word));
    }
    scan_.go_to_end();
    return true;
  }

  bool condition() {
    Expression condition = expression();
    if (scan_.is_done()) {
      block_.condition = condition;
    } else {
      block_.kind = BlockKind::jumps;
      jumps(condition);
    }
    return true;
  }

  /// One jump or several, each behind its condition.
  void jumps(Expression condition) {
    jump(condition);
    while (scan_.take_word("IF")) jump(expression());
  }

  void jump(Expression condition) {
    scan_.skip();
    Jump found{.condition = condition, .kind = {}, .target = {}, .column = scan_.column()};
    std::string_view command;
    for (const auto& [word, kind] : jump_words) {
      if (!scan_.take_word(word)) continue;
      command = word;
      found.kind = kind;
      break;
    }
    if (command.empty()) {
      throw scan_.error(
          fmt::format("{} after the condition: GOTOF, GOTOB, GOTO or GOTOC must follow, or nothing", scan_.rest()));
    }
    found.target = target();
    if (found.target.empty()) {
      throw scan_.error(fmt::format("{} without a label: one must follow, or N and the number of a block", command));
    }
    block_.jumps.push_back(std::move(found));
  }

  /// A label, or the number of a block with N before it or not.
  std::string target() {
    std::size_t begin = scan_.at();
    while (scan_.peek(begin) == ' ' || scan_.peek(begin) == '\t') ++begin;
    const std::size_t digits = begin + (scan_.peek(begin) == 'N' ? 1 : 0);
    std::size_t end = digits_end(scan_.text(), digits);
    if (end == digits) end = scan_.peek(begin) == '$' ? begin : scan_.name_end(begin);
    if (end == begin) return {};
    scan_.go_to(end);
    const std::string_view found = scan_.text().substr(begin, end - begin);
    return is_digits(found) ? fmt::format("N{}", without_zeros(found)) : std::string(found);
  }

  bool choice() {
    block_.condition = expression();
    if (!scan_.take_word("OF")) throw scan_.error(fmt::format("{} where OF is expected", scan_.rest_or(end_of_block)));
    while (!scan_.is_done()) jump(scan_.take_word("DEFAULT") ? Expression() : expression());
    return true;
  }

  bool counted() {
    block_.name = scan_.take_name();
    block_.index = read_indices(scan_, block_.pool);
    scan_.require("=", "= and the first value of FOR");
    block_.start = expression();
    if (!scan_.take_word("TO")) throw scan_.error(fmt::format("{} where TO is expected", scan_.rest_or(end_of_block)));
    block_.condition = expression();
    return true;
  }

  /// Whether P follows, with a number or with `=`.
  [[nodiscard]] bool is_count() const {
    const std::string_view text = scan_.text();
    std::size_t at = scan_.at();
    skip_spaces_of_any_kind(text, at);
    if (scan_.peek(at) != 'P') return false;
    skip_spaces_of_any_kind(text, ++at);
    if (scan_.peek(at) == '=') return true;
    return is_digit(scan_.peek(at));
  }

  /// REPEAT of a loop, or `REPEAT label P=n` of a part of the program.
  bool repeat() {
    if (scan_.is_done()) return true;
    block_.kind = BlockKind::again;
    block_.name = scan_.take_name();
    if (!scan_.is_done() && !is_count()) {
      throw scan_.error(fmt::format("{} after REPEAT {}: P= and a number must follow; an end label is not read",
                                    scan_.rest(), block_.name));
    }
    std::vector<Word> words;
    read_words(scan_, block_.pool, words);
    if (!words.empty()) block_.condition = words[0].value;
    return true;
  }

  bool definitions() {
    const Kind kind = type("DEF");
    do {
      scan_.skip();
      Definition found{.kind = kind, .name = {}, .column = scan_.column(), .shape = {}, .start = {}};
      found.name = scan_.take_name();
      if (found.name.empty() || found.name[0] == '$') {
        throw scan_.error(fmt::format("{} where the name of a variable is expected", scan_.rest_or(end_of_block)));
      }
      found.shape = read_indices(scan_, block_.pool);
      if (scan_.takes("=")) {
        if (!found.shape.empty()) {
          throw scan_.error(fmt::format("values of the array {}: they must be set one by one", found.name));
        }
        found.start = expression();
      }
      block_.parameters.push_back(std::move(found));
    } while (scan_.takes(","));
    return true;
  }

  Kind type(std::string_view what) {
    if (scan_.take_word("REAL")) return Kind::real;
    if (scan_.take_word("INT")) return Kind::whole;
    if (scan_.take_word("BOOL")) return Kind::boolean;
    if (scan_.take_word("STRING")) {
      static_cast<void>(read_indices(scan_, block_.pool));
      return Kind::text;
    }
    std::string found;
    for (const std::string_view each : {"CHAR", "AXIS", "FRAME"}) {
      if (found.empty() && scan_.take_word(each)) found = each;
    }
    if (found.empty()) found = scan_.rest_or("nothing");
    throw scan_.error(fmt::format("{} after {}: REAL, INT, BOOL or STRING is expected", found, what));
  }

  bool procedure() {
    block_.name = scan_.take_name();
    if (scan_.takes("(") && !scan_.takes(")")) {
      while (true) {
        parameter();
        if (scan_.takes(")")) break;
        scan_.require(",", "a comma or the closing bracket )");
      }
    }
    const std::string_view text = scan_.text();
    for (std::size_t at = text.find("SAVE", scan_.at()); at != std::string_view::npos; at = text.find("SAVE", at + 1)) {
      block_.saves |= scan_.is_word(at, "SAVE");
    }
    scan_.go_to_end();  // attributes of the display: DISPLOF, SBLOF ...
    return true;
  }

  void parameter() {
    Definition found;
    found.by_reference = scan_.take_word("VAR");
    found.kind = type("PROC (");
    scan_.skip();
    found.column = scan_.column();
    found.name = scan_.take_name();
    if (!read_indices(scan_, block_.pool).empty()) {
      throw scan_.error(fmt::format("{}: arrays as parameters are not read", found.name));
    }
    if (scan_.takes("=")) found.start = expression();
    block_.parameters.push_back(std::move(found));
  }

  Scanner& scan_;
  Block& block_;
};

}  // namespace

bool read_statement(Scanner& scan, std::string_view name, Block& block) {
  return StatementReader(scan, block).read(name);
}

}  // namespace shapegcode::siemens
