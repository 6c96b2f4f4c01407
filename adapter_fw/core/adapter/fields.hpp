// The settings by name, for whoever reads them from a console, a file or another language.
#pragma once

#include <cstdint>

#include "settings.hpp"

namespace adapter {

//: A number of a structure: its name, and how it is read and written as 64 bits.
template <typename Owner>
struct Field {
  const char* name;
  std::int64_t (*get)(const Owner& owner);
  void (*set)(Owner& owner, std::int64_t value);
};

//: Their order is part of the C interface (capi/adapter_capi.h).
std::int32_t setting_count();
const Field<Settings>& setting(std::int32_t place);

// Returns the place of a setting by its name, -1 where there is none.
std::int32_t find_setting(const char* name);

}  // namespace adapter

#define ADAPTER_FIELD(Owner, member)                                                               \
  {                                                                                                \
    #member, [](const Owner& owner) { return static_cast<std::int64_t>(owner.member); },           \
        [](Owner& owner, std::int64_t value) { owner.member = static_cast<decltype(owner.member)>(value); } \
  }
