#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace shapegcode {

/// Rows of a CSV file with LF: the row's word, a comma, and the numbers of its row in the table, each as the shortest
/// text that reads back as the same number. `word` numbers the words. Throws Error(argument) on another number of rows
/// than that of the table, or a number without a word.
[[nodiscard]] std::string csv_rows(std::span<const std::uint8_t> word, const std::vector<std::string>& words,
                                   const Eigen::Ref<const Eigen::MatrixXd>& table);

}  // namespace shapegcode
