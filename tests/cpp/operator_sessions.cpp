// Random sessions of an operator at a control: operator_sessions FIRST COUNT PERIODS.
#include <cstdio>
#include <cstdlib>

#include "operator_session.hpp"

int main(int argc, char** argv) {
  const auto number = [&](int place, unsigned long otherwise) {
    return argc > place ? std::strtoul(argv[place], nullptr, 10) : otherwise;
  };
  const unsigned long first = number(1, 0);
  const unsigned long count = number(2, 16);
  const unsigned long periods = number(3, 1000);
  unsigned long broken = 0;
  for (unsigned long seed = first; seed < first + count; ++seed) {
    shapegcode::tests::OperatorSession session(static_cast<std::uint32_t>(seed));
    const std::string what = session.run(periods);
    if (what.empty()) continue;
    ++broken;
    std::fprintf(stderr, "session %lu: %s\n", seed, what.c_str());
  }
  std::printf("operator_sessions: %lu sessions of %lu periods, %lu failures\n", count, periods, broken);
  return broken == 0 ? 0 : 1;
}
