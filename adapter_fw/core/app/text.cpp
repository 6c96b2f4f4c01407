#include "text.hpp"

namespace app {

void write_number(Writer& writer, std::int64_t value) {
  char digits[21];
  char* first = digits + sizeof digits - 1;
  *first = '\0';
  // Unsigned, so that the most negative number has its magnitude too.
  std::uint64_t size = value < 0 ? 0U - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
  do {
    *--first = static_cast<char>('0' + size % 10);
    size /= 10;
  } while (size != 0);
  if (value < 0) {
    *--first = '-';
  }
  writer.write(first);
}

bool read_number(const char* text, std::int64_t& value) {
  const bool is_negative = *text == '-';
  const char* digit = is_negative ? text + 1 : text;
  //: chosen: 18 digits fit 64 bits whatever they are.
  std::size_t digits = 0;
  std::int64_t size = 0;
  for (; *digit >= '0' && *digit <= '9' && digits < 18; ++digit, ++digits) {
    size = size * 10 + (*digit - '0');
  }
  if (digits == 0 || *digit != '\0') {
    return false;
  }
  value = is_negative ? -size : size;
  return true;
}

bool is_same(const char* one, const char* other) {
  while (*one != '\0' && *one == *other) {
    ++one;
    ++other;
  }
  return *one == *other;
}

Words::Words(char* line) {
  while (*line != '\0') {
    while (*line == ' ' || *line == '\t') {
      *line++ = '\0';
    }
    if (*line == '\0') {
      return;
    }
    if (count < MOST) {
      words[count] = line;
    }
    ++count;
    while (*line != '\0' && *line != ' ' && *line != '\t') {
      ++line;
    }
  }
}

}  // namespace app
