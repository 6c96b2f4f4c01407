// A game pad as the adapter's other master: plain reports in, a connect request and speeds out.
//
// Up connects, Down disconnects, R2 drives forward, L2 backward, the right stick
// turns: the mapping of the thesis. The connect request lasts from Up to Down, or until the
// pad is lost or the robot is; it has to be given anew then.
#pragma once

#include <cstdint>

#include "mixing.hpp"
#include "settings.hpp"

namespace adapter {

//: One report of a pad, of whatever make.
struct PadReport {
  bool up;
  bool down;
  std::int32_t forward;   // R2, 0 to TRIGGER_FULL
  std::int32_t backward;  // L2, likewise
  std::int32_t turn;      // right stick, -STICK_FULL - 1 (left) to STICK_FULL (right)
};

class Gamepad {
 public:
  explicit Gamepad(const Settings& settings)
      : trigger_dead_(settings.pad_trigger_dead),
        stick_dead_(settings.pad_stick_dead),
        loss_ns_(settings.pad_loss_ns) {}

  // Takes a report that came at `now`.
  void take(const PadReport& report, Nanos now);

  // Forgets the connect request: the session that it asked for has ended.
  void forget_request() { wants_robot_ = false; }

  bool wants_robot() const { return wants_robot_; }

  // Returns when the pad counts as lost unless a report comes before; NEVER before its first report.
  Nanos lost_at() const { return has_report_ ? reported_at_ + loss_ns_ : p2os::NEVER; }

  // Takes note that the pad is lost.
  void lose();

  // Returns the deflections after their dead zones: forward of TRIGGER_FULL, turn to the left of STICK_FULL.
  std::int32_t forward() const { return forward_; }
  std::int32_t turn() const { return turn_; }

 private:
  std::int32_t trigger_dead_;
  std::int32_t stick_dead_;
  Nanos loss_ns_;
  Nanos reported_at_{};
  std::int32_t forward_ = 0;
  std::int32_t turn_ = 0;
  bool has_report_ = false;
  bool was_up_ = true;
  bool wants_robot_ = false;
};

}  // namespace adapter
