#include "runner.hpp"

namespace app {

p2os::Nanos Runner::pass() {
  const p2os::Nanos now = look_for_gap();
  send();
  due_ = now;
  std::array<std::uint8_t, 64> bytes;
  for (std::size_t size = uart_.read(bytes.data(), bytes.size()); size != 0;
       size = uart_.read(bytes.data(), bytes.size())) {
    adapter_.receive({bytes.data(), size}, now);
  }
  adapter::PadReport report;
  while (pad_ != nullptr && pad_->take(report)) {
    adapter_.receive_pad(report, now);
  }
  adapter_.advance_to(now);
  if (adapter_.baud() != baud_) {
    baud_ = adapter_.baud();
    uart_.set_baud(baud_);
  }
  send();
  return due_ = adapter_.next_deadline();
}

p2os::Nanos Runner::look_for_gap() {
  const p2os::Nanos now = clock_.now();
  if (now > due_ + GAP_NS) {
    adapter_.skip_to("the program paused", now);
    due_ = now;
  }
  return now;
}

void Runner::send() {
  p2os::CommandFrame frame;
  // A machine can be suspended in any line, also between two frames: what was queued before it must not go out then.
  while (look_for_gap(), adapter_.take_output(frame)) {
    uart_.write(frame.bytes());
  }
}

}  // namespace app
