#include "runner.hpp"

namespace shell {

p2os::Nanos Runner::pass() {
  const p2os::Nanos now = clock_.now();
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
  p2os::CommandFrame frame;
  while (adapter_.take_output(frame)) {
    uart_.write(frame.bytes());
  }
  return adapter_.next_deadline();
}

}  // namespace shell
