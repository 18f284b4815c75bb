#include "shapegcode/simulation_stream.hpp"

#include <algorithm>
#include <array>
#include <charconv>

#include <fmt/format.h>

#include "shapegcode/error.hpp"

namespace shapegcode {

std::string csv_rows(std::span<const std::uint8_t> word, const std::vector<std::string>& words,
                     const Eigen::Ref<const Eigen::MatrixXd>& table) {
  if (static_cast<Eigen::Index>(word.size()) != table.rows()) {
    throw Error(ErrorKind::argument, fmt::format("{} words for {} rows: must be as many", word.size(), table.rows()));
  }
  if (!word.empty() && *std::max_element(word.begin(), word.end()) >= words.size()) {
    throw Error(ErrorKind::argument,
                fmt::format("word {} of {} does not exist", *std::max_element(word.begin(), word.end()), words.size()));
  }
  constexpr std::size_t typical_number = 14;
  std::string text;
  text.reserve(static_cast<std::size_t>(table.size()) * typical_number);
  std::array<char, 32> digits{};  // the longest double takes 24
  for (Eigen::Index row = 0; row < table.rows(); ++row) {
    text += words[word[static_cast<std::size_t>(row)]];
    for (Eigen::Index column = 0; column < table.cols(); ++column) {
      text += ',';
      // A sum of positions may be minus zero.
      const double value = table(row, column) == 0.0 ? 0.0 : table(row, column);
      const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value);
      text.append(digits.data(), end.ptr);
    }
    text += '\n';
  }
  return text;
}

}  // namespace shapegcode
