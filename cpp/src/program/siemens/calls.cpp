// Calls of subprograms: values, what is left out, VAR, SAVE.
#include <fmt/format.h>

#include <algorithm>

#include "program/siemens/line_text.hpp"
#include "program/siemens/run.hpp"

namespace shapegcode::siemens {
namespace {

constexpr std::size_t most_calls = 16;  // of subprograms, the main program among them

/// Notes which variables an expression reads.
class Probe : public Scope {
 public:
  Value value_of(const std::string& name, std::span<const Value> index, std::uint32_t /*column*/) override {
    found.emplace_back(name, std::vector<Value>(index.begin(), index.end()));
    return whole_value(1.0);  // which no function refuses
  }

  std::vector<std::pair<std::string, std::vector<Value>>> found;
};

}  // namespace

Run::Program Run::find(const std::string& name) {
  if (const auto known = programs_.find(name); known != programs_.end()) return known->second;
  Program found;
  if (options_.called) {
    if (const std::optional<SourceText> source = options_.called(name)) {
      found = programs_of_text(source->text, source->name, name)[0];
      found->name = name;
    }
  }
  programs_[name] = found;
  return found;
}

void Run::call_named(const std::string& name, const Word& word) {
  const std::size_t folder = name.find_last_of("/\\");
  std::string own = capitals(std::string_view(name).substr(folder == std::string::npos ? 0 : folder + 1));
  if (own.starts_with("_N_")) own.erase(0, 3);
  const Program found = find(own);
  if (found == nullptr) throw word.error(fmt::format("\"{}\": no such program is in the folder of this one", name));
  call(found, found->name, word.column, {});
}

void Run::call(const Program& program, const std::string& name, std::uint32_t column,
               std::span<const Expression> given) {
  if (locals_.size() >= most_calls) {
    throw error_at(column, fmt::format("{}: calls reach {} levels, the control has no more", name, most_calls));
  }
  const std::vector<std::string>& files = path_.out.files();
  if (program->file != options_.file && std::ranges::find(files, program->file) == files.end()) {
    path_.out.add_file(program->file);
  }
  const std::shared_ptr<const Block> head = heading(*program);
  if (head == nullptr && !given.empty()) {
    throw error_at(column, fmt::format("{}( ) with values: PROC with parameters must begin {}", name, program->file));
  }
  Variables variables;
  std::vector<Reference> references;
  if (head != nullptr) references = parameters(*head, name, column, given, variables);
  const std::uint32_t line = path_.line;
  const std::uint32_t file = path_.file;
  const Modes modes = path_.modes;
  calls_.push_back(line);
  execute(*program, variables);
  calls_.pop_back();
  path_.line = line;
  path_.file = file;
  for (const Reference& each : references) {
    assign(each.name, each.index, variables.at(each.parameter).read(each.parameter, {}, column), column);
  }
  if (head != nullptr && head->saves) words_.restore(modes);
}

std::shared_ptr<const Block> Run::heading(ProgramLines& program) {
  for (std::size_t index = 0; index < program.size(); ++index) {
    const std::string_view line = program.line(index);
    if (holds_word(line, "PROC")) {
      std::shared_ptr<const Block> block = program.block(index);
      return block->kind == BlockKind::procedure ? block : nullptr;
    }
    if (!without_spaces(line.substr(0, line.find(';'))).empty()) return nullptr;
  }
  return nullptr;
}

std::vector<Run::Reference> Run::parameters(const Block& head, const std::string& name, std::uint32_t column,
                                            std::span<const Expression> given, Variables& variables) {
  const std::vector<Definition>& wanted = head.parameters;
  if (given.size() > wanted.size()) {
    throw error_at(column, fmt::format("{} with {} values: PROC has {} parameters", name, given.size(), wanted.size()));
  }
  std::vector<Reference> references;
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    const Definition& parameter = wanted[k];
    const Expression value = k < given.size() ? given[k] : Expression();
    Variable variable(parameter.kind);
    if (const Expression& start = value ? value : parameter.start) {
      variable.write(parameter.name, {}, start(*this), column);
    }
    variables.insert_or_assign(parameter.name, std::move(variable));
    if (!parameter.by_reference || !value) continue;
    Probe probe;
    static_cast<void>(value(probe));
    if (probe.found.size() != 1 || !knows(probe.found[0].first)) {
      throw error_at(column, fmt::format("{}: a value for a parameter with VAR must be a variable", name));
    }
    std::erase_if(references, [&](const Reference& each) { return each.parameter == parameter.name; });
    references.push_back({.parameter = parameter.name,
                          .name = std::move(probe.found[0].first),
                          .index = std::move(probe.found[0].second)});
  }
  return references;
}

}  // namespace shapegcode::siemens
