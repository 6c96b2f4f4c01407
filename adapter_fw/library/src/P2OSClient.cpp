#include "P2OSClient.h"

using p2os::CommandFrame;
using p2os::CommandNumber;

namespace {

constexpr p2os::Nanos DRIVE_NS = P2OSClient::DRIVE_MS * p2os::NS_PER_MS;
constexpr p2os::Nanos REFRESH_NS = P2OSClient::REFRESH_MS * p2os::NS_PER_MS;
//: Two changes are so far apart: a pair takes 18.75 ms at 9600 baud.
constexpr p2os::Nanos SPACING_NS = 25 * p2os::NS_PER_MS;

//: The step between two 15-bit positions.
int32_t step(uint16_t from, uint16_t to) {
  const uint16_t difference = static_cast<uint16_t>(to - from) & 0x7FFF;
  return difference < 0x4000 ? difference : difference - 0x8000;
}

}  // namespace

P2OSClient::P2OSClient(Stream& line, const P2OSRobot& robot)
    : line_(line), robot_(robot), client_(p2os::ClientSettings()) {
  client_.set_listener(this);
  for (int32_t& sonar : sonars_) {
    sonar = -1;
  }
}

void P2OSClient::disconnect() {
  wanted_ = false;
  forward_ = turn_ = 0;
  client_.abandon();
  update();
}

void P2OSClient::drive(int forwardMmS, int turnDegS) {
  isChanged_ = isChanged_ || forwardMmS != forward_ || turnDegS != turn_;
  forward_ = forwardMmS;
  turn_ = turnDegS;
  driveUntil_ = now() + DRIVE_NS;
}

void P2OSClient::update() {
  const p2os::Nanos at = now();
  uint8_t bytes[32];
  for (int ready = line_.available(); ready > 0; ready = line_.available()) {
    size_t size = 0;
    while (size < sizeof bytes && ready-- > 0) {
      bytes[size++] = static_cast<uint8_t>(line_.read());
    }
    client_.receive({bytes, size}, at);
  }
  if (wanted_) {
    client_.connect(at);
  }
  client_.advance_to(at);
  if (client_.is_open()) {
    send_speeds(at);
  }
  CommandFrame frame;
  while (client_.take_output(frame)) {
    line_.write(frame.bytes().data, frame.bytes().size);
  }
}

float P2OSClient::sonar(uint8_t number) const {
  return number < SONARS && sonars_[number] >= 0 ? static_cast<float>(sonars_[number]) * robot_.mmPerSonarCount : -1.0f;
}

p2os::Nanos P2OSClient::now() {
  const uint32_t ticks = static_cast<uint32_t>(micros());
  now_ += static_cast<uint32_t>(ticks - lastMicros_) * p2os::NS_PER_US;
  lastMicros_ = ticks;
  return now_;
}

void P2OSClient::send_speeds(p2os::Nanos at) {
  if (at >= driveUntil_ && (forward_ != 0 || turn_ != 0)) {
    forward_ = turn_ = 0;
    isChanged_ = true;
  }
  if (at - saidAt_ >= (isChanged_ ? SPACING_NS : REFRESH_NS)) {
    client_.send(CommandFrame(CommandNumber::VEL, forward_), at);
    client_.send(CommandFrame(CommandNumber::RVEL, turn_), at);
    saidAt_ = at;
    isChanged_ = false;
  }
}

// A speed wished for before the loss means nothing after it.
void P2OSClient::session_opened(const p2os::Identity& robot, p2os::Nanos at) {
  identity_ = robot;
  forward_ = turn_ = 0;
  hasPosition_ = false;
  xCounts_ = yCounts_ = 0;
  client_.send(CommandFrame(CommandNumber::SETO), at);
  client_.send(CommandFrame(CommandNumber::SONAR, 1), at);
  client_.send(CommandFrame(CommandNumber::ENABLE, 1), at);
}

void P2OSClient::session_ended(p2os::EndReason, p2os::Nanos) { forward_ = turn_ = 0; }

void P2OSClient::take_sip(const p2os::Sip& sip, p2os::Nanos) {
  if (hasPosition_) {
    xCounts_ += step(lastX_, sip.raw_x);
    yCounts_ += step(lastY_, sip.raw_y);
  }
  hasPosition_ = true;
  lastX_ = sip.raw_x;
  lastY_ = sip.raw_y;
  heading_ = sip.raw_heading;
  left_ = sip.raw_left_velocity;
  right_ = sip.raw_right_velocity;
  decivolts_ = sip.raw_battery;
  isStalled_ = sip.stall_left || sip.stall_right;
  for (uint8_t place = 0; place < sip.sonar_count; ++place) {
    const p2os::SonarReading reading = sip.sonar(place);
    if (reading.number < SONARS) {
      sonars_[reading.number] = reading.raw_range;
    }
  }
  ++packets_;
}
