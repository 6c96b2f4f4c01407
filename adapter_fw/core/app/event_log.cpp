#include "event_log.hpp"

namespace app {

void EventLog::happened(p2os::Nanos now, adapter::What what, const char* detail, std::int32_t first,
                        std::int32_t second) {
  entries_[count_ % KEPT] = {now, what, detail, first, second};
  ++count_;
}

void EventLog::write(Writer& writer) const {
  const std::uint32_t kept = count_ < KEPT ? count_ : static_cast<std::uint32_t>(KEPT);
  for (std::uint32_t place = count_ - kept; place != count_; ++place) {
    write_entry(entries_[place % KEPT], writer);
  }
}

void EventLog::write_last(Writer& writer) const {
  if (count_ != 0) {
    write_entry(entries_[(count_ - 1) % KEPT], writer);
  }
}

void EventLog::write_entry(const Entry& entry, Writer& writer) {
  write_number(writer, entry.at / p2os::NS_PER_MS);
  writer.write(" ms ");
  writer.write(adapter::text(entry.what));
  if (entry.what == adapter::What::COMMAND || entry.what == adapter::What::STALL) {
    const bool is_command = entry.what == adapter::What::COMMAND;
    writer.write(is_command ? ": VEL " : ": left ");
    write_number(writer, entry.first);
    writer.write(is_command ? ", RVEL " : ", right ");
    write_number(writer, entry.second);
  } else if (*entry.detail != '\0') {
    writer.write(": ");
    writer.write(entry.detail);
  }
  writer.write("\n");
}

}  // namespace app
