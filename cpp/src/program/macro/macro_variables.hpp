#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>

#include "program/macro/macro_expression.hpp"

namespace shapegcode {

/// The variables from #1000 on. This base class knows none of them.
class SystemVariables {
 public:
  virtual ~SystemVariables() = default;
  /// Sets `value` to that of #number; false: there is no such variable (alarm 115).
  virtual bool read(int number, MacroValue& value);
  /// Sets #number; false: it cannot be written (alarm 116 if it can be read, else 115).
  virtual bool write(int number, MacroValue value);
};

/// The variables of custom macro B: #0 always vacant; #1 ... #33 of the present call level; #100 ... #199, vacant at
/// the start; #500 ... #999, which the control retains over power off; from #1000 those of the control.
class MacroVariables : public VariableAccess {
 public:
  static constexpr std::size_t max_levels = 5;  ///< main program and four macro calls

  /// `retained`: values of #500 ... #999 at the start; `system` (may be null) must outlive this object. Throws
  /// Error(argument) on a number outside 500 ... 999 or a value that is not finite.
  explicit MacroVariables(const std::map<int, double>& retained = {}, SystemVariables* system = nullptr);

  /// Beyond what VariableAccess says: a retained variable that was neither given nor written, or one that was
  /// forgotten, throws UnknownValue, because its value is in the control only.
  [[nodiscard]] MacroValue read(int number, std::uint32_t line, std::uint32_t column) override;
  void write(int number, MacroValue value, std::uint32_t line, std::uint32_t column) override;
  [[nodiscard]] bool signed_angles() const noexcept override { return signed_angles_; }
  /// Parameter 6004#0 (NAT), see VariableAccess::signed_angles.
  void set_signed_angles(bool on) noexcept { signed_angles_ = on; }

  /// Begins the level of a macro call with #1 ... #33 = arguments[1 ... 33]. Throws alarm 122 beyond five levels.
  void push_level(const std::array<MacroValue, 34>& arguments, std::uint32_t line = 0, std::uint32_t column = 0);
  /// Back to the caller's locals. Throws Error(argument) on the level of the main program.
  void pop_level();
  /// The value of a common variable is not known any more, until it is written; 0: of all of them.
  void forget(int number = 0) noexcept;
  /// 0: main program.
  [[nodiscard]] std::size_t level() const noexcept { return level_; }

 private:
  struct Retained {
    MacroValue value;
    bool known = false;
  };
  // Where #number of the program is stored; null: #0 and everything outside this object.
  MacroValue* find(int number) noexcept;

  std::array<std::array<MacroValue, 34>, max_levels> locals_{};
  std::array<MacroValue, 100> common_{};
  std::array<bool, 100> common_forgotten_{};
  std::array<Retained, 500> retained_{};
  SystemVariables* system_;
  std::size_t level_ = 0;
  bool signed_angles_ = false;
};

}  // namespace shapegcode
