#include "board_test.hpp"

namespace app {

void BoardTest::begin(p2os::Nanos now) {
  is_on_ = true;
  came_back_ = 0;
  hardware_.out.release(now);
}

void BoardTest::end(p2os::Nanos now) {
  is_on_ = false;
  hardware_.out.release(now);
  if (driven_ != 0) {
    hardware_.out.drive(driven_, levels_, now);
  }
}

void BoardTest::hold(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now) {
  hardware_.out.release(now);
  if (mask != 0) {
    hardware_.out.drive(mask, levels & mask, now);
  }
}

std::size_t BoardTest::take_back(std::array<std::uint8_t, KEPT_BYTES>& data) {
  const std::size_t size = came_back_ < KEPT_BYTES ? came_back_ : KEPT_BYTES;
  for (std::size_t place = 0; place < size; ++place) {
    data[place] = back_[(came_back_ - size + place) % KEPT_BYTES];
  }
  came_back_ = 0;
  return size;
}

void BoardTest::drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now) {
  driven_ |= mask;
  levels_ = (levels_ & ~mask) | (levels & mask);
  if (!is_on_) {
    hardware_.out.drive(mask, levels, now);
  }
}

void BoardTest::release(p2os::Nanos now) {
  driven_ = 0;
  if (!is_on_) {
    hardware_.out.release(now);
  }
}

std::size_t BoardTest::read(std::uint8_t* data, std::size_t size) {
  const std::size_t taken = hardware_.line.read(data, size);
  if (!is_on_) {
    return taken;
  }
  for (std::size_t place = 0; place < taken; ++place) {
    back_[came_back_++ % KEPT_BYTES] = data[place];
  }
  // Nothing is left for the adapter; what is still in the driver comes with the next pass.
  return 0;
}

bool BoardTest::take(adapter::PadReport& report) {
  if (hardware_.pad == nullptr || !hardware_.pad->take(report)) {
    return false;
  }
  ++reports_;
  report_ = report;
  return !is_on_;
}

}  // namespace app
