// Private: calls that run, and the values of parameters while a program runs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <vector>

#include "program/linuxcnc/interpreter_state.hpp"
#include "program/linuxcnc/parameter_names.hpp"
#include "program/linuxcnc/source_file.hpp"

namespace shapegcode::linuxcnc {

inline constexpr std::size_t max_arguments = 30;

/// A call that runs.
struct Frame {
  std::size_t back = 0;  ///< line behind the call
  SourceFile* caller = nullptr;
  std::size_t begin = 0;
  std::array<double, max_arguments + 1> locals{};
  std::unordered_map<NameId, double> names;
  std::unordered_map<std::size_t, std::int64_t> repeats;  ///< left, by the line of REPEAT
  std::optional<Modes> saved;
  bool restores = false;
  std::int64_t again = 0;  ///< repetitions of M98 that are left
  bool by_m98 = false;
};

class ParameterTable {
 public:
  /// No parameter has a value yet: the numbered ones are 0.
  ParameterTable(const State& state, std::vector<Frame>& frames, const ParameterNames& names);

  /// The value of `#number`; #1 to #30 are the subroutine's own.
  [[nodiscard]] double numbered(std::int64_t number) const;
  /// The value of `#<name>`; those that begin with _ are global.
  [[nodiscard]] double named(NameId name) const;
  [[nodiscard]] bool exists(NameId name) const { return find(name).has_value(); }

  void set_numbered(double parameter, double value);
  void set_named(NameId name, double value);

 private:
  [[nodiscard]] std::optional<double> find(NameId name) const;
  /// #5210 ... #5428, #5599: offsets in the machine's unit, the position in the program's.
  [[nodiscard]] std::optional<double> of_state(std::int64_t number) const;
  [[nodiscard]] std::optional<double> of_tool(std::int64_t number) const;
  [[nodiscard]] std::optional<double> of_modes(Predefined what) const;
  [[nodiscard]] std::optional<double> predefined(Predefined what) const;

  const State& state_;
  std::vector<Frame>& frames_;
  const ParameterNames& names_;
  std::vector<double> numbered_;
  std::unordered_map<NameId, double> global_;
};

}  // namespace shapegcode::linuxcnc
