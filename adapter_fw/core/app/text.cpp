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

void write_hex(Writer& writer, std::uint32_t value, std::size_t digits) {
  char text[9] = {};
  for (std::size_t place = digits < 8 ? digits : 8; place-- > 0; value >>= 4) {
    text[place] = "0123456789abcdef"[value & 0xF];
  }
  writer.write(text);
}

bool read_hex(const char* text, std::uint32_t& value) {
  value = 0;
  std::size_t digits = 0;
  for (; *text != '\0' && digits < 8; ++text, ++digits) {
    const bool is_letter = *text >= 'a' && *text <= 'f';
    if (!is_letter && (*text < '0' || *text > '9')) {
      return false;
    }
    value = value << 4 | static_cast<std::uint32_t>(is_letter ? *text - 'a' + 10 : *text - '0');
  }
  return digits != 0 && *text == '\0';
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
