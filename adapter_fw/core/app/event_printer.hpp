// An observer that keeps each event in the log and prints it at once.
#pragma once

#include "event_log.hpp"

namespace app {

class EventPrinter final : public adapter::Observer {
 public:
  EventPrinter(EventLog& log, Writer& writer) : log_(log), writer_(writer) {}

  void happened(p2os::Nanos now, adapter::What what, const char* detail, std::int32_t first,
                std::int32_t second) override {
    log_.happened(now, what, detail, first, second);
    log_.write_last(writer_);
  }

 private:
  EventLog& log_;
  Writer& writer_;
};

}  // namespace app
