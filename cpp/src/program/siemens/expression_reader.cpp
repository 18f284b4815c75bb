// Reading of expressions. Priorities of the operators: Programming Manual 12/2019, easymanua.ls 1265481 p. 444.
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "program/siemens/expression.hpp"

namespace shapegcode::siemens {
namespace {

struct Operator {
  std::string_view sign;
  Operation operation = Operation::equal;
  int rank = 0;  // from the weakest to the strongest
};

// A sign stands before those that it begins with.
constexpr std::array<Operator, 19> operators = {{{"==", Operation::equal, 0},
                                                 {"<>", Operation::unequal, 0},
                                                 {">=", Operation::at_least, 0},
                                                 {"<=", Operation::at_most, 0},
                                                 {"<<", Operation::join, 1},
                                                 {">", Operation::greater, 0},
                                                 {"<", Operation::less, 0},
                                                 {"-", Operation::difference, 8},
                                                 {"+", Operation::sum, 8},
                                                 {"*", Operation::product, 9},
                                                 {"/", Operation::quotient, 9},
                                                 {"B_AND", Operation::bit_and, 7},
                                                 {"B_OR", Operation::bit_or, 5},
                                                 {"B_XOR", Operation::bit_xor, 6},
                                                 {"AND", Operation::both, 4},
                                                 {"OR", Operation::either, 2},
                                                 {"XOR", Operation::exclusive, 3},
                                                 {"DIV", Operation::whole_quotient, 9},
                                                 {"MOD", Operation::remainder, 9}}};

const Operator* operator_at(const Scanner& scan) {
  const char first = scan.peek();
  for (const Operator& each : operators) {
    if (each.sign[0] != first) continue;
    if (is_capital(first) ? scan.is_word(scan.at(), each.sign) : scan.text().substr(scan.at()).starts_with(each.sign)) {
      return &each;
    }
  }
  return nullptr;
}

class ExpressionReader {
 public:
  ExpressionReader(Scanner& scan, ExpressionPool& pool) : scan_(scan), pool_(pool) {}

  std::uint32_t expression(int above = -1) {
    const Scanner::Level level(scan_);
    std::uint32_t left = unary();
    while (true) {
      scan_.skip();
      const std::size_t begin = scan_.at();
      const Operator* found = operator_at(scan_);
      if (found == nullptr || found->rank <= above) return left;
      scan_.go_to(begin + found->sign.size());
      const std::uint32_t right = expression(found->rank);
      left = pool_.add({.operation = found->operation, .column = scan_.column(begin), .left = left, .right = right});
    }
  }

  std::vector<std::uint32_t> indices() {
    if (!scan_.takes("[")) return {};
    std::vector<std::uint32_t> found = {expression()};
    while (scan_.takes(",")) found.push_back(expression());
    scan_.require("]", "a closing bracket ]");
    return found;
  }

  /// What is left out is `none`.
  std::vector<std::uint32_t> arguments(std::string_view name) {
    scan_.require("(", fmt::format("the opening bracket of {}(", name));
    if (scan_.takes(")")) return {};
    std::vector<std::uint32_t> found;
    while (true) {
      scan_.skip();
      found.push_back(scan_.peek() == ',' || scan_.peek() == ')' ? none : expression());
      if (scan_.takes(")")) return found;
      scan_.require(",", fmt::format("a comma or the closing bracket of {}(", name));
    }
  }

  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

 private:
  std::uint32_t unary() {
    const Scanner::Level level(scan_);
    const std::size_t begin = scan_.at();
    scan_.skip();
    auto operation = Operation::constant;
    if (scan_.takes("-")) {
      operation = Operation::minus;
    } else if (scan_.takes("+")) {
      operation = Operation::plus;
    } else if (scan_.take_word("B_NOT")) {
      operation = Operation::bit_negation;
    } else if (scan_.take_word("NOT")) {
      operation = Operation::negation;
    } else {
      return primary();
    }
    const std::uint32_t inner = unary();
    return pool_.add({.operation = operation, .column = scan_.column(begin), .left = inner});
  }

  std::uint32_t primary() {
    const std::size_t begin = scan_.at();
    if (scan_.takes("(")) {
      const std::uint32_t inner = expression();
      scan_.require(")", "a closing bracket )");
      return inner;
    }
    if (const std::size_t end = scan_.number_end(begin); end > begin) {
      const std::string_view text = scan_.text().substr(begin, end - begin);
      scan_.go_to(end);
      return pool_.add_constant(is_digits(text) ? whole_value(number_of(without_zeros(text)))
                                                : real_value(scanned_number(text)));
    }
    if (scan_.peek() == '"') {
      if (const std::size_t end = scan_.text().find('"', begin + 1); end != std::string_view::npos) {
        scan_.go_to(end + 1);
        return pool_.add_constant(text_value(scan_.text().substr(begin + 1, end - begin - 1)));
      }
    }
    if (scan_.peek() == '\'') {
      if (const std::size_t end = bits_end(begin); end > begin) {
        scan_.go_to(end);
        return pool_.add_constant(whole_value(bits(scan_.text().substr(begin + 1, end - begin - 2))));
      }
    }
    return named(begin);
  }

  std::size_t bits_end(std::size_t begin) const {
    if (scan_.peek(begin + 1) != 'H' && scan_.peek(begin + 1) != 'B') return begin;
    std::size_t end = begin + 2;
    while (is_digit(scan_.peek(end)) || (scan_.peek(end) >= 'A' && scan_.peek(end) <= 'F')) ++end;
    return end > begin + 2 && scan_.peek(end) == '\'' ? end + 1 : begin;
  }

  /// Of H or B and digits.
  static double bits(std::string_view text) {
    const int base = text[0] == 'H' ? 16 : 2;
    double value = 0.0;
    for (const char c : text.substr(1)) {
      const int digit = is_digit(c) ? c - '0' : c - 'A' + 10;
      if (digit >= base) throw too_large();
      value = value * base + digit;
    }
    return value;
  }

  std::uint32_t named(std::size_t begin) {
    const std::string_view name = scan_.take_name();
    if (name.empty()) {
      throw scan_.error(
          fmt::format("{} where a number, a variable or ( is expected", scan_.rest_or("the end of the block")));
    }
    if (name == "TRUE" || name == "FALSE") return pool_.add_constant(truth(name == "TRUE"));
    if (name == "$PI") return pool_.add_constant(real_value(std::numbers::pi));
    if (const auto function = function_of(name)) {
      std::vector<std::uint32_t> given = arguments(name);
      std::erase(given, none);
      if (given.size() != function->count) {
        throw scan_.error(fmt::format("{} takes {} value{}, not {}", name, function->count,
                                      function->count > 1 ? "s" : "", given.size()),
                          begin);
      }
      return pool_.add_function(function->function, given, scan_.column(begin));
    }
    if (name[0] == '$') {
      throw scan_.error(fmt::format("{}: system variables are not read, their values are in the control", name), begin);
    }
    if (scan_.peek() == '(') throw scan_.error(fmt::format("{}( ) is not a function that is read", name), begin);
    const std::vector<std::uint32_t> index = indices();
    return pool_.add_variable(name, index, scan_.column(begin));
  }

  Scanner& scan_;
  ExpressionPool& pool_;
};

std::vector<Expression> expressions(const ExpressionPool& pool, const std::vector<std::uint32_t>& roots) {
  std::vector<Expression> found;
  found.reserve(roots.size());
  for (const std::uint32_t root : roots) {
    found.push_back(root == ExpressionReader::none ? Expression() : Expression(pool, root));
  }
  return found;
}

}  // namespace

Expression read_expression(Scanner& scan, ExpressionPool& pool) {
  return {pool, ExpressionReader(scan, pool).expression()};
}

std::vector<Expression> read_indices(Scanner& scan, ExpressionPool& pool) {
  return expressions(pool, ExpressionReader(scan, pool).indices());
}

std::vector<Expression> read_arguments(Scanner& scan, ExpressionPool& pool, std::string_view name) {
  return expressions(pool, ExpressionReader(scan, pool).arguments(name));
}

}  // namespace shapegcode::siemens
