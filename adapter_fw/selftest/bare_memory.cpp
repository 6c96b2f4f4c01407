// What the compiler calls without being asked to, where there is no C library.

#include <cstddef>

extern "C" void* memset(void* to, int value, std::size_t size) {
  auto* bytes = static_cast<volatile unsigned char*>(to);
  for (std::size_t place = 0; place < size; ++place) {
    bytes[place] = static_cast<unsigned char>(value);
  }
  return to;
}

extern "C" void* memcpy(void* to, const void* from, std::size_t size) {
  auto* bytes = static_cast<volatile unsigned char*>(to);
  const auto* source = static_cast<const unsigned char*>(from);
  for (std::size_t place = 0; place < size; ++place) {
    bytes[place] = source[place];
  }
  return to;
}

extern "C" void* memmove(void* to, const void* from, std::size_t size) {
  auto* bytes = static_cast<volatile unsigned char*>(to);
  const auto* source = static_cast<const unsigned char*>(from);
  if (bytes <= source) {
    return memcpy(to, from, size);
  }
  while (size-- > 0) {
    bytes[size] = source[size];
  }
  return to;
}
