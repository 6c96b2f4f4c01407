// Writes a self-test's result in lines of `name value`, on whatever takes characters.
#pragma once

#include "selftest.hpp"

namespace selftest {

using Write = void (*)(const char* text);

void write_number(Write write, std::uint32_t value);

// Writes a line a number; the last one is `ok` or `failed` and why.
void report(const Result& result, Write write);

}  // namespace selftest
