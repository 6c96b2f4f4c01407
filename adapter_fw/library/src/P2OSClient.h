// A P2OS robot at the other end of an Arduino Stream.
//
// Not the protocol: that is p2os/client.hpp, which knows neither Arduino nor a clock.
// Everything happens in update(); nothing blocks, nothing is allocated.
#pragma once

#include <Arduino.h>

#include "p2os/client.hpp"

// How a robot counts; the defaults are those of a Pioneer 2-DX.
struct P2OSRobot {
  float mmPerCount = 0.84f;
  float degPerCount = 360.0f / 4096.0f;
  float mmPerSPerCount = 1.0f;
  float mmPerSonarCount = 0.268f;
};

class P2OSClient : private p2os::ClientListener {
 public:
  static constexpr uint8_t SONARS = 16;
  //: drive() holds so long, ms: a sketch that hangs stops the robot.
  static constexpr uint32_t DRIVE_MS = 500;
  //: A speed is sent again after so long, ms: P2OS acknowledges nothing.
  static constexpr uint32_t REFRESH_MS = 200;

  explicit P2OSClient(Stream& line, const P2OSRobot& robot = P2OSRobot());

  // Begins to look for the robot; goes on by itself until disconnect().
  void connect() { wanted_ = true; }

  // Stops the robot and lets it go.
  void disconnect();

  // Does what is due; call it at least every 10 ms.
  void update();

  // Sets the speeds, mm/s forward and deg/s to the left, for DRIVE_MS from now.
  void drive(int forwardMmS, int turnDegS);

  // Stops at once.
  void stop() { drive(0, 0); }

  bool isOpen() const { return client_.is_open(); }
  // The subclass that the robot answered with, for example "p2dx"; empty before the first connection.
  const char* subclass() const { return identity_.subclass.data(); }

  // The pose that the robot reports, from where it was opened: mm, mm, degrees to the left.
  float x() const { return static_cast<float>(xCounts_) * robot_.mmPerCount; }
  float y() const { return static_cast<float>(yCounts_) * robot_.mmPerCount; }
  float heading() const { return heading_ * robot_.degPerCount; }
  float leftMmS() const { return left_ * robot_.mmPerSPerCount; }
  float rightMmS() const { return right_ * robot_.mmPerSPerCount; }
  float battery() const { return decivolts_ / 10.0f; }
  bool isStalled() const { return isStalled_; }
  // The last reading of a sonar, mm; -1 while there is none.
  float sonar(uint8_t number) const;

  uint32_t packets() const { return packets_; }
  const p2os::DecoderStats& lineStats() const { return client_.wire_stats(); }

 private:
  void session_opened(const p2os::Identity& robot, p2os::Nanos now) override;
  void session_ended(p2os::EndReason reason, p2os::Nanos now) override;
  void take_sip(const p2os::Sip& sip, p2os::Nanos now) override;
  p2os::Nanos now();
  void send_speeds(p2os::Nanos now);

  Stream& line_;
  P2OSRobot robot_;
  p2os::Client client_;
  p2os::Identity identity_;
  bool wanted_ = false;
  // micros() widened: it wraps after 71 minutes.
  uint32_t lastMicros_ = 0;
  p2os::Nanos now_ = 0;
  int forward_ = 0, turn_ = 0;
  p2os::Nanos driveUntil_ = 0, saidAt_ = 0;
  bool isChanged_ = false;
  bool hasPosition_ = false;
  uint16_t lastX_ = 0, lastY_ = 0;
  int32_t xCounts_ = 0, yCounts_ = 0;
  int16_t heading_ = 0, left_ = 0, right_ = 0;
  uint8_t decivolts_ = 0;
  bool isStalled_ = false;
  uint32_t packets_ = 0;
  int32_t sonars_[SONARS];
};
