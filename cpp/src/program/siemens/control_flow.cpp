// Statements of control flow, as they are executed.
#include <fmt/format.h>

#include <array>

#include "program/siemens/run.hpp"

namespace shapegcode::siemens {

std::size_t Run::control(Flow& flow, const Block& block, std::size_t index) {
  if (is_skipped(block)) return index + 1;
  words_.comment(block.comment);
  switch (block.kind) {
    case BlockKind::jumps:
      for (std::size_t k = 0; k < block.jumps.size(); ++k) {
        const Jump& each = block.jumps[k];
        if (!each.condition || is_true(each.condition(*this))) return jump(flow, each, index, k);
      }
      return index + 1;
    case BlockKind::choice: {
      const Value chosen = block.condition(*this);
      for (std::size_t k = 0; k < block.jumps.size(); ++k) {
        const Jump& each = block.jumps[k];
        if (!each.condition || is_equal(chosen, each.condition(*this))) return jump(flow, each, index, k);
      }
      return index + 1;
    }
    case BlockKind::again:
      return again(flow, block, index);
    case BlockKind::definitions:
      define(block);
      return index + 1;
    default:
      return loop(flow, block, index);
  }
}

std::size_t Run::loop(Flow& flow, const Block& block, std::size_t index) {
  ProgramLines& program = flow.program;
  switch (block.kind) {
    case BlockKind::if_begins:
    case BlockKind::while_begins:
      return is_true(block.condition(*this)) ? index + 1 : program.partner(index) + 1;
    case BlockKind::else_begins:
      return program.partner(index) + 1;
    case BlockKind::while_ends:
    case BlockKind::loop_ends:
      return program.start(index);
    case BlockKind::until:
      return is_true(block.condition(*this)) ? index + 1 : program.start(index) + 1;
    case BlockKind::for_begins:
      set_counter(block, block.start(*this));
      return counts_on(block) ? index + 1 : program.partner(index) + 1;
    case BlockKind::for_ends: {
      const std::size_t begin = program.start(index);
      const std::shared_ptr<const Block> head = program.block(begin);
      set_counter(*head, work(Operation::sum, counter(*head), whole_value(1.0), head->column));
      return counts_on(*head) ? begin + 1 : index + 1;
    }
    default:
      return index + 1;
  }
}

std::size_t Run::jump(Flow& flow, const Jump& jump, std::size_t index, std::size_t ordinal) const {
  if (const auto found = flow.program.target(jump, index, ordinal)) return *found;
  if (jump.kind == JumpKind::quiet) return index + 1;
  constexpr std::array<std::pair<std::string_view, std::string_view>, 3> ways = {
      {{"GOTO", "anywhere near"}, {"GOTOF", "after"}, {"GOTOB", "before"}}};
  const auto& [command, where] = ways[static_cast<std::size_t>(jump.kind)];
  throw error_at(jump.column, fmt::format("{} {}: no such label or block {} it, outside of other IF and loops", command,
                                          jump.target, where));
}

std::size_t Run::again(Flow& flow, const Block& block, std::size_t index) {
  const std::int64_t count = block.condition ? whole(block.condition(*this), "P", block.column) : 1;
  std::int64_t& left = flow.again.emplace(index, count).first->second;
  if (left <= 0) {
    flow.again.erase(index);
    return index + 1;
  }
  --left;
  if (const auto found = flow.program.label_before(block.name, index)) return *found;
  throw error_at(block.column, fmt::format("REPEAT {}: there is no such label before it", block.name));
}

void Run::define(const Block& block) {
  for (const Definition& each : block.parameters) {
    if (locals_.back()->contains(each.name)) continue;  // reached again by a jump
    std::vector<std::int64_t> shape;
    for (const Expression& size : each.shape) {
      shape.push_back(whole(size(*this), "size of " + each.name, each.column));
    }
    Variable variable(each.kind, std::move(shape));
    if (each.start) variable.write(each.name, {}, convert(each.start(*this), each.kind, each.column), each.column);
    locals_.back()->emplace(each.name, std::move(variable));
  }
}

void Run::set_counter(const Block& block, const Value& value) {
  if (!knows(block.name)) {
    throw error_at(block.column,
                   fmt::format("{} of FOR is not a variable of this program: DEF must define it before", block.name));
  }
  assign(block.name, worked_out(block.index), value, block.column);
}

Value Run::counter(const Block& block) {
  Value found = value_of(block.name, worked_out(block.index), block.column);
  found.number = number(found, block.column);
  return found;
}

bool Run::counts_on(const Block& block) {
  const double now = counter(block).number;
  const double end = number(block.condition(*this), block.column);
  return is_equal(real_value(now), real_value(end)) || now < end;
}

}  // namespace shapegcode::siemens
