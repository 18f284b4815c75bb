#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "program/siemens/expression.hpp"
#include "program/siemens/value.hpp"
#include "program/siemens/word_names.hpp"

// Blocks of SINUMERIK programs: heads, words, statements of control flow, definitions. How blocks are made up:
// Programming Manual 12/2019, easymanua.ls 1265481 pp. 43 to 45; statements of control flow as nc-gcode-interpreter 0.2
// reads them, which cites the SINUMERIK ONE manual, sections 4.1.5 and 4.1.7.
namespace shapegcode::siemens {

enum class Mode : std::uint8_t { none, absolute, incremental };  // none, =AC(...), =IC(...)

/// One word of a block.
struct Word {
  std::string name;  // "X", "CR", "M"; of a G code with its number, "G1"; of a call or a bare word its name
  WordId id = WordId::other;
  Mode mode = Mode::none;
  bool has_brackets = false;  // of a call `NAME(...)`
  std::uint32_t column = 1;
  Expression value;               // what stands behind the address; none: nothing
  std::vector<Expression> index;  // of `NAME[...]=`
  std::vector<Expression> given;  // in the brackets of a call

  [[nodiscard]] Error error(const std::string& message) const { return error_at(column, message); }
};

enum class JumpKind : std::uint8_t { either_way, forward, backward, quiet };  // GOTO, GOTOF, GOTOB, GOTOC

/// A jump, and under which condition.
struct Jump {
  Expression condition;
  JumpKind kind = JumpKind::either_way;
  std::string target;  // label, or N and the number of a block
  std::uint32_t column = 1;
};

/// A variable of DEF, or a parameter of PROC.
struct Definition {
  Kind kind = Kind::real;
  std::string name;
  std::uint32_t column = 1;
  std::vector<Expression> shape;
  Expression start;
  bool by_reference = false;
};

// clang-format off
enum class BlockKind : std::uint8_t {
  words, if_begins, else_begins, if_ends, while_begins, while_ends, for_begins, for_ends, loop_begins, loop_ends,
  repeat_begins, until, jumps, choice, again, definitions, procedure, external
};
// clang-format on

/// A block as it was read; what `kind` says decides which fields count. Its expressions refer to it.
struct Block {
  Block() = default;
  Block(const Block&) = delete;
  Block& operator=(const Block&) = delete;

  BlockKind kind = BlockKind::words;
  bool is_skipped = false;  // where the switch for `/` is on
  std::string number;       // "N10"
  std::string label;
  std::uint32_t column = 1;
  std::vector<Word> words;
  Expression condition;  // of IF, WHILE, UNTIL; what CASE chooses by; where FOR ends; how often of AGAIN
  std::vector<Jump> jumps;
  std::string name;  // of the variable of FOR, the label of AGAIN, the program of PROC
  std::vector<Expression> index;
  Expression start;                    // of FOR
  std::vector<Definition> parameters;  // of DEF and PROC
  bool saves = false;                  // PROC ... SAVE
  std::string comment;
  ExpressionPool pool;
};

/// Read a line.
[[nodiscard]] std::shared_ptr<const Block> read_block(std::string_view line);

/// Read the words up to the end of a line.
void read_words(Scanner& scan, ExpressionPool& pool, std::vector<Word>& words);

/// Read a statement of control flow or a definition that begins with a name; false: the block is one of words.
[[nodiscard]] bool read_statement(Scanner& scan, std::string_view name, Block& block);

}  // namespace shapegcode::siemens
