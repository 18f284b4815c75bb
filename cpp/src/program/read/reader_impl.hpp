// Private: the execution of programs. Lines go to the Interpreter in the order of execution: simple blocks unchanged,
// all others expanded to simple blocks. Spread over three files: texts and lines (reader.cpp), calls
// (reader_calls.cpp), macro statements (reader_macros.cpp).
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "program/interpret/interpreter_impl.hpp"
#include "program/macro/macro_statement.hpp"
#include "program/macro/macro_variables.hpp"
#include "program/read/program_store.hpp"
#include "program/rewrite/move_rewriter.hpp"

namespace shapegcode::detail {

/// #1000 and above: what a program may ask the control.
class ControlVariables : public SystemVariables {
 public:
  ControlVariables(const ReaderOptions& options, Interpreter& interpreter, const MoveRewriter& rewriter)
      : options_(options), interpreter_(interpreter), rewriter_(rewriter) {}
  bool read(int number, MacroValue& value) override;
  bool write(int number, MacroValue value) override;

  std::int64_t last_m = 0;
  std::int64_t last_n = 0;
  std::int64_t last_t = 0;
  std::int64_t program = 0;
  int modal_call = 67;

 private:
  [[nodiscard]] bool modal(int number, MacroValue& value) const;
  [[nodiscard]] bool last_reported(int number, MacroValue& value) const;
  [[nodiscard]] bool offset(int number, MacroValue& value) const;
  [[nodiscard]] std::optional<double>* tool_field(int number, ToolOffset& offset, int& tool) const;
  [[nodiscard]] bool work_slot(int number, int& system, int& extra, int& axis) const;
  [[nodiscard]] double to_program_units(double value_mm) const;

  const ReaderOptions& options_;
  Interpreter& interpreter_;
  const MoveRewriter& rewriter_;
  std::map<int, double> written_;  // switches such as #3003 that only the program itself sets
};

/// O0012: at least four digits.
[[nodiscard]] std::string program_name(std::int64_t number);

/// Thrown by a reading: a program that it called asks for values that only the control knows.
struct OpaqueProgram {
  std::int64_t number;
};

class Reader {
 public:
  /// Programs of `shut` are called, but not looked into even where they are at hand; it outlives the reader.
  /// `steps`: that readings of the same text have taken before.
  Reader(std::string text, const ReaderOptions& options, std::span<const std::int64_t> shut, std::uint64_t steps);
  Program run();
  /// The text that was handed over, behind a `run` that ended with OpaqueProgram.
  [[nodiscard]] std::uint64_t steps() const noexcept { return steps_; }
  [[nodiscard]] std::string take_text() noexcept { return std::move(sources_.front().text); }

 private:
  struct Loop {
    int number = 0;
    LinePosition start;   ///< the line of WHILE or DO
    std::size_t end = 0;  ///< offset behind END
  };
  struct Frame {
    ProgramUnit* unit = nullptr;
    LinePosition next;  ///< the next line
    std::vector<Loop> loops;
    bool macro = false;        ///< has its own local variables
    bool modal = false;        ///< called by G66
    bool by_code = false;      ///< called by a bound G, M or T code
    int repeats = 1;           ///< passes that are left, this one counted
    MacroArguments arguments;  ///< for the next pass
  };
  struct ModalCall {
    MacroArguments arguments;
    bool every_block = false;  ///< G66.1
  };

  // Texts and lines.
  [[nodiscard]] bool is_shut(std::int64_t number) const noexcept;
  void load_main();
  void expand_from(std::size_t begin);
  bool step();
  void require_room();
  void require_room_for(const std::string& text);
  void line(std::string_view text, std::size_t begin, std::size_t end);
  void plain_line(std::size_t begin, std::size_t end);
  void program_line(std::size_t end);
  void run_block(const ParsedBlock& block, std::string_view raw);
  void put_block(const ParsedBlock& block);
  void note_number(const BlockWords& words);
  void note_words(const BlockWords& words);
  void put(std::string_view flat, const LineOrigin& origin);
  void put(const ParsedBlock& block, const LineOrigin& origin);
  void run_written(const ParsedBlock& block, const LineOrigin& origin, std::size_t begin);
  void put_raw(std::string_view flat, const LineOrigin& origin);
  void finish();
  Program result();
  bool record(const Error& error);
  [[nodiscard]] Error located(const Error& error) const;
  [[nodiscard]] std::string call_stack() const;
  [[noreturn]] void fail(const std::string& message, std::uint32_t column = 1) const;
  [[noreturn]] void alarm(int number, const std::string& message, std::uint32_t column = 1) const;
  void warn(const std::string& message);

  // Calls.
  [[nodiscard]] bool is_call(const BlockWords& words) const noexcept;
  void call_block(const ParsedBlock& block, std::string_view raw);
  void subprogram_call(const ParsedBlock& block);
  void subprogram_return(const ParsedBlock& block);
  void macro_call(const ParsedBlock& block, std::string_view raw, int g_tenths);
  void bound_call(const ParsedBlock& block, std::string_view raw);
  void modal_calls();
  bool enter(const MacroArguments& arguments, bool macro, std::uint32_t column, std::string_view text,
             const std::string& by = {});  // false: the call was kept as it stands
  ProgramUnit* lookup(std::int64_t number);
  void leave();
  void put_without(const ParsedBlock& block, const std::function<bool(const Word&)>& left_out);

  // Macro statements.
  void macro_line(std::size_t begin);
  void assignment(std::string_view text, std::size_t at);
  void nc_block(std::string_view text);
  void keep_for_control(std::string_view statement, int target);
  void conditional_lasting(std::string_view text, const MacroStatement& statement);
  void jump(std::int64_t n, std::uint32_t column);
  void loop_start(std::string_view text, const MacroStatement& statement, const LinePosition& here);
  void loop_end(const MacroStatement& statement);
  [[nodiscard]] std::string with_values(std::string_view text);
  [[nodiscard]] WordFormat word_format() const;
  [[nodiscard]] std::array<double, 26> argument_scale() const;

  const ReaderOptions& options_;
  std::span<const std::int64_t> shut_;
  Program program_;
  std::deque<SourceText> sources_;  ///< the text that was handed over, and those of programs in other files
  ProgramStore store_;
  std::set<std::int64_t> sought_;  ///< programs that no file holds
  std::set<std::int64_t> called_;
  Interpreter interpreter_;
  MoveRewriter rewriter_;
  ControlVariables control_;
  MacroVariables variables_;
  // Each is read in one place and keeps while the line is executed.
  ParsedBlock line_;      ///< the line of the program
  ParsedBlock computed_;  ///< the same with values in place of variables
  ParsedBlock rest_;      ///< of a call: what stands beside it
  ParsedBlock written_;   ///< a plain line that the rewriter made
  std::vector<Frame> frames_;
  std::vector<ModalCall> modal_calls_;
  LineOrigin origin_;
  LinePosition here_;  ///< the line that is executed
  bool framed_ = false;
  bool moved_ = false;  ///< the line that is executed moves an axis
  std::uint64_t steps_;
  std::uint64_t bytes_read_ = 0;
  std::uint64_t lines_read_ = 0;
};

}  // namespace shapegcode::detail
