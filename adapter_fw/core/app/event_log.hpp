// The last events of the adapter, for a person who asks what happened.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "../adapter/adapter.hpp"
#include "text.hpp"

namespace app {

class EventLog final : public adapter::Observer {
 public:
  static constexpr std::size_t KEPT = 32;

  void happened(p2os::Nanos now, adapter::What what, const char* detail, std::int32_t first,
                std::int32_t second) override;

  // Writes the kept events, oldest first, a line each.
  void write(Writer& writer) const;
  // Writes the newest one.
  void write_last(Writer& writer) const;

  // Returns how many have happened so far.
  std::uint32_t count() const { return count_; }

 private:
  struct Entry {
    p2os::Nanos at;
    adapter::What what;
    const char* detail;
    std::int32_t first;
    std::int32_t second;
  };

  static void write_entry(const Entry& entry, Writer& writer);

  std::array<Entry, KEPT> entries_{};
  std::uint32_t count_ = 0;
};

}  // namespace app
