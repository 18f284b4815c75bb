// Coverage-guided fuzzing of the program reader; `make fuzz`.
#include "reader_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  shapegcode::fuzz::check_reader({data, size});
  return 0;
}
