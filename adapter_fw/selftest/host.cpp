// The self-test on a PC: `selftest [SECONDS [SEED]]`.

#include <cstdio>
#include <cstdlib>

#include "report.hpp"

int main(int count, char** words) {
  const long seconds = count > 1 ? std::strtol(words[1], nullptr, 10) : 60;
  const unsigned long seed = count > 2 ? std::strtoul(words[2], nullptr, 10) : 1;
  const selftest::Result result =
      selftest::run(seconds * p2os::NS_PER_S, static_cast<std::uint32_t>(seed));
  selftest::report(result, [](const char* text) { std::fputs(text, stdout); });
  return result.failure == nullptr ? 0 : 1;
}
