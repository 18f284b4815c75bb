#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "program/siemens/block_words.hpp"
#include "program/siemens/path.hpp"
#include "program/siemens/program_lines.hpp"
#include "program/siemens/variable.hpp"

namespace shapegcode::siemens {

/// Where jumps of one execution of a program lead.
struct Flow {
  ProgramLines& program;
  std::unordered_map<std::size_t, std::int64_t> again;  // REPEAT label: how often it is left to be done, by its line
};

/// A program in execution; the scope of its expressions. Subprograms: easymanua.ls 1265481 pp. 491 to 494; jumps and
/// loops as nc-gcode-interpreter 0.2 has them (SINUMERIK ONE manual 4.1.5, 4.1.7).
class Run : public Scope {
 public:
  Run(std::string_view text, const SiemensOptions& options);

  [[nodiscard]] SiemensProgram program();

  /// A variable, or an R parameter.
  [[nodiscard]] Value value_of(const std::string& name, std::span<const Value> index, std::uint32_t column) override;
  /// Whether something can be set by this name.
  [[nodiscard]] bool knows(const std::string& name) const;
  /// Set a variable or an R parameter.
  void assign(const Word& word, const Value& value);
  /// CALL and EXTCALL of a program by a string.
  void call_named(const std::string& name, const Word& word);

 private:
  using Program = std::shared_ptr<ProgramLines>;
  /// A variable that a parameter with VAR stands for.
  struct Reference {
    std::string parameter;
    std::string name;
    std::vector<Value> index;
  };

  void assign(const std::string& name, std::span<const Value> index, const Value& value, std::uint32_t column);
  [[nodiscard]] std::optional<std::int64_t> parameter_number(const std::string& name, std::span<const Value> index,
                                                             std::uint32_t column) const;
  [[nodiscard]] std::vector<Value> worked_out(const std::vector<Expression>& expressions);

  /// Execute a program to its end; says which word ended it.
  End execute(ProgramLines& program, Variables& variables);
  /// One block; the line that follows, or none: the program has ended, as `end` says.
  std::optional<std::size_t> step(Flow& flow, std::size_t index, End& end);
  void require_limits() const;
  [[nodiscard]] Error located(const ProgramLines& program, std::size_t index, std::uint32_t column,
                              const std::string& message) const;
  [[nodiscard]] bool is_skipped(const Block& block) const;
  End words(const Block& block);

  [[nodiscard]] Program find(const std::string& name);
  void call(const Program& program, const std::string& name, std::uint32_t column, std::span<const Expression> given);
  /// PROC at the start of a program.
  [[nodiscard]] static std::shared_ptr<const Block> heading(ProgramLines& program);
  [[nodiscard]] std::vector<Reference> parameters(const Block& head, const std::string& name, std::uint32_t column,
                                                  std::span<const Expression> given, Variables& variables);

  /// A statement of control flow; gives the line that follows.
  std::size_t control(Flow& flow, const Block& block, std::size_t index);
  std::size_t loop(Flow& flow, const Block& block, std::size_t index);
  std::size_t jump(Flow& flow, const Jump& jump, std::size_t index, std::size_t ordinal) const;
  std::size_t again(Flow& flow, const Block& block, std::size_t index);
  void define(const Block& block);
  void set_counter(const Block& block, const Value& value);
  [[nodiscard]] Value counter(const Block& block);
  [[nodiscard]] bool counts_on(const Block& block);

  const SiemensOptions& options_;
  SiemensPath path_;
  BlockWords words_;
  std::unordered_map<std::string, Program> programs_;  // by name; null: there is none
  Program main_;
  std::unordered_map<std::int64_t, double> r_;
  std::vector<Variables*> locals_;
  std::vector<std::uint32_t> calls_;  // their lines
  std::int64_t steps_left_;
  std::int64_t moves_left_;
};

}  // namespace shapegcode::siemens
