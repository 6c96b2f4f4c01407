// Lines of text without a C library: what a console writes, and the words that it is given.
#pragma once

#include <cstddef>
#include <cstdint>

namespace app {

//: Takes text; the console's only way out.
class Writer {
 public:
  virtual void write(const char* text) = 0;

 protected:
  ~Writer() = default;
};

void write_number(Writer& writer, std::int64_t value);

// Reads a whole decimal number; false where the text is none, or does not fit.
[[nodiscard]] bool read_number(const char* text, std::int64_t& value);

// Writes the lowest `digits` hexadecimal digits.
void write_hex(Writer& writer, std::uint32_t value, std::size_t digits);

// Reads one to eight hexadecimal digits, lower case; false where the text is none.
[[nodiscard]] bool read_hex(const char* text, std::uint32_t& value);

bool is_same(const char* one, const char* other);

//: A line cut into its words, in place.
struct Words {
  static constexpr std::size_t MOST = 3;
  const char* words[MOST] = {};
  std::size_t count = 0;

  // Cuts a line at its blanks; words beyond the third are counted and left out.
  explicit Words(char* line);
};

}  // namespace app
