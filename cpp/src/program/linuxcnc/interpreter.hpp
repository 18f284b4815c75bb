// Private: executes the lines of a LinuxCNC program. Control flow, parameters and modes are those of LinuxCNC 2.9's
// documentation; tests hold the moves against its own interpreter rs274.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "program/dialect/expanded_lines.hpp"
#include "program/linuxcnc/block_runner.hpp"
#include "program/linuxcnc/expression.hpp"
#include "program/linuxcnc/interpreter_state.hpp"
#include "program/linuxcnc/parameter_table.hpp"
#include "program/linuxcnc/plain_lines.hpp"
#include "program/linuxcnc/source_file.hpp"
#include "shapegcode/linuxcnc_program.hpp"

namespace shapegcode::linuxcnc {

class Interpreter {
 public:
  Interpreter(std::string_view text, const LinuxcncOptions& options);

  [[nodiscard]] LinuxcncProgram run();

 private:
  // Lines.

  /// The first line: behind an opening `%`.
  void enter_main();
  void run_lines();
  /// Take lines in which nothing differs as they are.
  bool take_plain_lines();
  /// Plain lines from the next one on that need nothing of the slow way; count 0: there are none.
  PlainLines find_plain_lines();
  /// Mode, feed and position behind lines that were taken as they are.
  void follow(const PlainLines& lines);
  void step(std::size_t index);
  void run_block(std::size_t index, const Block& block);
  /// The words of a line; null: an empty one, or `%`.
  const Block* block(std::size_t index);
  /// Whether a line with `/` is left out, by the state of the block-skip switch.
  bool is_skipped();
  void require_steps() const;

  // Control flow.

  void control(std::size_t index, OLine& line);
  void run_conditional(std::size_t index, OLine& line);
  void run_while(std::size_t index, OLine& line);
  void run_repeat(std::size_t index, OLine& line);
  void end_repeat(std::size_t index, OLine& line);
  /// The line of the loop that an ENDWHILE or ENDREPEAT closes.
  std::size_t opening(std::size_t index, const OLine& line, Keyword keyword);
  std::size_t behind(std::size_t index, const OLine& line, std::initializer_list<Keyword> keywords);
  /// The last line of the loop of this label around a line.
  std::size_t loop_end(std::size_t index, const OLine& line);
  /// The values in brackets behind a keyword.
  std::vector<double> values(OLine& line);
  double condition(OLine& line);

  // Calls.

  void call(std::size_t index, OLine& line);
  std::pair<SourceFile*, std::size_t> subroutine(const std::string& label, Keyword keyword);
  SourceFile& load(const std::string& label);
  Frame& enter(SourceFile& file, std::size_t begin, std::size_t index);
  void leave();
  void return_from(OLine& line);
  [[nodiscard]] std::string call_stack() const;

  // M codes that call and save.

  void run_special(int code, const WordValues& values, std::size_t index);
  void call_program(const WordValues& values, std::size_t index);
  void end_program(std::size_t index);

  const LinuxcncOptions& options_;
  SourceFile main_;
  SourceFile* file_ = &main_;
  std::unordered_map<std::string, std::unique_ptr<SourceFile>> files_;  ///< by the label that called them
  std::vector<std::uint8_t> n_words_;                                   ///< how often each N stands in the main program
  dialect::ExpandedLines lines_;
  State state_;
  BlockRunner runner_;
  ParameterNames names_;
  std::vector<Frame> frames_;
  ParameterTable parameters_;
  Evaluator evaluate_;
  BlockWords words_;                            ///< of the block that runs
  std::vector<std::pair<double, double>> set_;  ///< likewise its settings: parameter, value
  Block once_;                                  ///< a line of a file in which none is executed twice
  NameId value_;
  NameId value_returned_;
  std::size_t next_ = 0;
  std::uint64_t steps_ = 0;
  std::uint64_t read_lines_;
  bool broke_ = false;
  // Lines of `file_` behind the first one and before the second are plain, and yet not taken as they are.
  std::size_t slow_from_ = 0;
  std::size_t slow_to_ = 0;
};

}  // namespace shapegcode::linuxcnc
