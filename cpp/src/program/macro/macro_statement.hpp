#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "program/macro/macro_expression.hpp"

namespace shapegcode {

enum class MacroStatementKind : std::uint8_t {
  nc_block,    ///< words only; operands may be variables: `substitute`, or `parse_arguments` for a macro call
  assignment,  ///< #i = expression
  go_to,       ///< GOTO n
  if_go_to,    ///< IF [condition] GOTO n (also with THEN in front of GOTO)
  if_then,     ///< IF [condition] THEN #i = expression
  while_do,    ///< WHILE [condition] DO m
  do_loop,     ///< DO m
  end_loop,    ///< END m
  output,      ///< POPEN, PCLOS, BPRNT[...], DPRNT[...]: sends text to a port, moves nothing; its text is not checked
};

/// Structure of a line; indices count from 0 in the line.
struct MacroStatement {
  MacroStatementKind kind = MacroStatementKind::nc_block;
  std::int64_t n_number = -1;  ///< -1: none
  bool optional_skip = false;
  int skip_switch = 1;        ///< of '/' (1) or '/1' ... '/9'
  int loop = 0;               ///< number of DO and END, 1 ... 3
  std::size_t condition = 0;  ///< index of the '[' of IF and WHILE
  std::size_t body = 0;       ///< index of the assignment's first character, or of the operand of GOTO
};

/// Tells the kind of a line (without its line end) without evaluating it. Keywords may be cut down to two letters (GO,
/// WH, EN ...). Throws Error(program): alarm 114 malformed; 126 DO or END without a number 1 ... 3; 127 words of an NC
/// block and a macro statement in one block; 3 sequence number of more than 8 digits.
[[nodiscard]] MacroStatement parse_statement(std::string_view line, std::uint32_t line_number);

/// Carries out "#i=expression" or "#[expression]=expression" from index `at` to the end of the block. One assignment a
/// block: no manual of FANUC shows more (alarm 114). "#3000=n(TEXT)" throws the program's own alarm 3000 + n.
void execute_assignment(std::string_view line, std::size_t at, std::uint32_t line_number, VariableAccess& variables);

/// The sequence number behind GOTO (a number, a variable or an expression in brackets, rounded). Alarm 128 unless it is
/// 1 ... 99999999 (a 30i; older controls end at 9999 or 99999).
[[nodiscard]] std::int64_t go_to_target(std::string_view line, std::size_t at, std::uint32_t line_number,
                                        VariableAccess& variables);

/// Decimals to which a computed value of an address is rounded (the control's least increment).
struct WordFormat {
  int length_decimals = 3;  ///< X Y Z U V W I J K R Q, ",R" and ",C" (mm or inch)
  int angle_decimals = 3;   ///< A B C and ",A" (degrees)
  int feed_decimals = 4;    ///< F and E; fewer where the value would have more than 8 digits
  int dwell_decimals = 3;   ///< X and U of G04 (seconds)
};

/// An NC block whose operands are numbers: variables and expressions are replaced by their rounded values, words with a
/// vacant operand are left out, everything else stays as it is. Lengths, angles and feeds are written with a decimal
/// point ("X12.5", "X-3."), so that they mean mm, inch, degrees whatever the control's decimal-point setting; G has at
/// most one decimal (G54.1); D H L M N O P S T are whole numbers. In an operand ROUND rounds to the decimals of its
/// address, as the manuals say. Throws Error(program): what expressions throw; 3 a value of more than 8 digits; 114 an
/// operand of N, O or '/' (they cannot be variables), an expression without brackets; 127 an assignment in the block.
[[nodiscard]] std::string substitute(std::string_view line, std::uint32_t line_number, VariableAccess& variables,
                                     const WordFormat& format);

/// What a macro call hands over.
struct MacroArguments {
  std::array<MacroValue, 34> locals;  ///< #1 ... #33; #0 is vacant
  std::int64_t program = -1;          ///< P, -1: none
  int repeats = 1;                    ///< L
};

/// Reads the arguments of a block with G65, G66 or G66.1, or of a block that calls a macro by its first word (a G, M, T
/// ... code that the machine binds to one): that word, a leading N and '/' are no arguments.
/// Argument specification I: A B C I J K D E F H M Q R S T U V W X Y Z are #1 ... #9, #11, #13, #17 ... #26;
/// specification II: A B C, then up to ten times I J K: #1 ... #33. An I, J or K that does not come behind the one
/// before it in the alphabet begins the next set (the control finds specification II by that). Where both name a
/// variable the later word counts. A constant without decimal point is multiplied by
/// `scale_without_point[letter - 'A']`; values of variables and expressions are taken as they are.
/// Throws Error(program): 129 for G, N, O among the arguments, an eleventh set, arguments in front of G65; 76 for a P
/// that is no program number; 3 and 114 as above.
[[nodiscard]] MacroArguments parse_arguments(std::string_view line, std::uint32_t line_number,
                                             VariableAccess& variables,
                                             const std::array<double, 26>& scale_without_point);

}  // namespace shapegcode
