// Source lines of a program that was translated from another control's dialect.
#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "shapegcode/error.hpp"
#include "shapegcode/program.hpp"

namespace shapegcode {

void lead_back(Program& program, std::string source, const std::vector<LineOrigin>& lines,
               const std::vector<std::string>& files, std::vector<Finding> notes) {
  const std::uint32_t needed = program.expanded ? 0U : program.line_count;
  if (lines.size() < std::max<std::size_t>(needed, 1)) {
    throw Error(ErrorKind::argument,
                fmt::format("{} lines of the source are given for {} of the program", lines.size(), needed));
  }
  const auto own_files = static_cast<std::uint32_t>(program.files.size());
  for (const LineOrigin& line : lines) {
    if (line.file > files.size()) {
      throw Error(ErrorKind::argument, fmt::format("file {} of {} is named for a line", line.file, files.size()));
    }
  }
  program.files.insert(program.files.end(), files.begin(), files.end());
  // File 0 is the program's own in both lists.
  const auto origin_of = [&](const LineOrigin& line) {
    if (line.file != 0 || line.line == 0) {
      return line;
    }
    const LineOrigin& from = lines[std::min<std::size_t>(line.line, lines.size()) - 1];
    return LineOrigin{from.line, from.file == 0 ? 0U : own_files + from.file - 1};
  };
  if (program.expanded) {
    std::ranges::transform(program.origins, program.origins.begin(), origin_of);
  } else {
    program.origins.reserve(program.line_count);
    for (std::uint32_t line = 1; line <= program.line_count; ++line) {
      program.origins.push_back(origin_of({line, 0}));
    }
  }
  for (ProgramCall& call : program.calls) {
    call.origin = origin_of(call.origin);
  }
  for (std::vector<Finding>* const findings : {&program.warnings, &program.alarms}) {
    for (Finding& finding : *findings) {
      if (finding.file.empty()) {
        const LineOrigin from = origin_of({finding.line, 0});
        finding.line = from.line;
        finding.file = program.files[from.file];
        finding.column = 0;  // of the plain program's line
      }
    }
  }
  program.warnings.insert(program.warnings.begin(), std::make_move_iterator(notes.begin()),
                          std::make_move_iterator(notes.end()));
  program.unexpanded = std::move(source);
  program.expanded = true;
}

}  // namespace shapegcode
