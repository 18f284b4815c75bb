#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "../fuzz/reader_check.hpp"

namespace {

std::vector<std::uint8_t> bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

}  // namespace

TEST_CASE("what the fuzzer has found is read without harm") {
  const std::filesystem::path tests = SHAPEGCODE_TESTS_DIR;
  std::size_t count = 0;
  for (const auto* folder : {"fuzz/corpus/reader", "golden/dialect", "rejected"}) {
    for (const auto& entry : std::filesystem::directory_iterator(tests / folder)) {
      if (entry.path().extension() == ".expected") {
        continue;
      }
      CAPTURE(entry.path().filename().string());
      shapegcode::fuzz::check_reader(bytes_of(entry.path()));
      ++count;
    }
  }
  CHECK(count > 100);
}
