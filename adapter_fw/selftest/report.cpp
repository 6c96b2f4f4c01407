#include "report.hpp"

namespace selftest {

void write_number(Write write, std::uint32_t value) {
  char digits[11];
  char* first = digits + sizeof digits - 1;
  *first = '\0';
  do {
    *--first = static_cast<char>('0' + value % 10);
    value /= 10;
  } while (value != 0);
  write(first);
}

void report(const Result& result, Write write) {
  const struct {
    const char* name;
    std::uint32_t value;
  } rows[] = {
      {"hash ", result.hash},         {"frames ", result.frames},     {"pin_changes ", result.pin_changes},
      {"sessions ", result.sessions}, {"losses ", result.losses},     {"resets ", result.resets},
      {"rejected ", result.rejected},
  };
  for (const auto& row : rows) {
    write(row.name);
    write_number(write, row.value);
    write("\n");
  }
  write(result.failure == nullptr ? "ok" : "failed: ");
  write(result.failure == nullptr ? "" : result.failure);
  write("\n");
}

}  // namespace selftest
