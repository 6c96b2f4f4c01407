// The Arduino library on a PC: its Stream ends at the self-test's robot, its micros() are virtual.
//
// Prints each broken claim; ends with `ok` and exit code 0, or with 1.

#include <P2OSClient.h>

#include <cstdio>

#include "robot.hpp"

namespace {

//: Shortly before micros() wraps.
uint64_t microseconds = 0xFFFF'FFFFULL - 2'000'000;
int broken = 0;

void claim(bool holds, const char* what) {
  if (!holds) {
    std::printf("broken: %s\n", what);
    ++broken;
  }
}

p2os::Nanos now() { return static_cast<p2os::Nanos>(microseconds) * p2os::NS_PER_US; }

class Line final : public Stream {
 public:
  size_t write(uint8_t byte) override { return write(&byte, 1); }
  size_t write(const uint8_t* data, size_t size) override {
    if (!isCut) {
      robot.receive({data, size}, now());
    }
    return size;
  }
  int available() override { return isCut ? 0 : static_cast<int>(robot.output().size - taken_); }
  int read() override {
    const uint8_t byte = robot.output()[taken_++];
    if (taken_ == robot.output().size) {
      robot.forget_output();
      taken_ = 0;
    }
    return byte;
  }

  selftest::Robot robot;
  bool isCut = false;

 private:
  size_t taken_ = 0;
};

void pass(P2OSClient& client, Line& line, uint32_t spanMs) {
  for (uint32_t passed = 0; passed < spanMs; passed += 5) {
    microseconds += 5'000;
    line.robot.advance_to(now());
    client.update();
  }
}

void check_session() {
  Line line;
  P2OSClient client(line);
  pass(client, line, 500);
  claim(!client.isOpen(), "nothing happens before connect()");
  client.connect();
  pass(client, line, 1'000);
  claim(client.isOpen() && client.packets() > 0, "it connects");
  claim(client.subclass()[0] == 'p', "the robot has identified itself");
  for (int turn = 0; turn < 20; ++turn) {
    client.drive(200, 0);
    pass(client, line, 100);
  }
  claim(line.robot.forward_mm_s() == 200, "it drives, also while micros() wraps");
  claim(client.x() > 300 && client.x() < 500, "the odometry is in millimetres");
  claim(client.leftMmS() > 199 && client.sonar(3) > 0 && client.battery() > 11.9f, "readings come with units");
  claim(client.sonar(15) < 0 && client.sonar(200) < 0, "what is not known is -1");
  pass(client, line, P2OSClient::DRIVE_MS - 200);
  claim(line.robot.forward_mm_s() == 200, "drive() holds");
  pass(client, line, 300);
  claim(line.robot.forward_mm_s() == 0, "a sketch that forgets stops the robot");
  client.drive(0, 40);
  pass(client, line, 100);
  line.robot.reboot();
  pass(client, line, 3'000);
  claim(client.isOpen() && line.robot.turn_deg_s() == 0, "a robot that restarts is found again and stands");
  client.drive(100, 0);
  pass(client, line, 100);
  client.disconnect();
  pass(client, line, 3'000);
  claim(!client.isOpen() && line.robot.forward_mm_s() == 0, "disconnect() stops and stays away");
}

}  // namespace

unsigned long micros() { return static_cast<unsigned long>(microseconds & 0xFFFF'FFFF); }
unsigned long millis() { return static_cast<unsigned long>(microseconds / 1'000 & 0xFFFF'FFFF); }

int main() {
  check_session();
  if (broken == 0) {
    std::puts("ok");
  }
  return broken == 0 ? 0 : 1;
}
