// The speeds that are commanded: whether the robot follows, and when a pair goes out.
//
// P2OS acknowledges nothing. The only feedback is the pair of wheel speeds in each
// SIP: a robot that obeys is near its command, or comes nearer, or reports a stall.
// Each SIP that shows one of the three passes the plausibility check; when none has
// done so for plausibility_ns, the robot's motion is implausible. The theory stands in
// adapter_sim/driver.py.
#pragma once

#include <cstdint>

#include "mixing.hpp"
#include "settings.hpp"

namespace adapter {

class PlausibilityCheck {
 public:
  explicit PlausibilityCheck(const Settings& settings)
      : timeout_ns_(settings.plausibility_ns),
        tolerance_mm_s_(settings.plausibility_tolerance_mm_s),
        progress_mm_s_(settings.plausibility_progress_mm_s) {}

  // Starts anew, with the wheels at rest.
  void begin(Nanos now);

  // Takes a command that is being sent; a new one measures progress from here, and buys no time.
  void expect(Wheels command);

  // Takes the wheel speeds and stall flags of a SIP.
  void take(Wheels measured, bool stalled, Nanos now);

  // Returns when the motion becomes implausible unless a SIP passes before.
  Nanos ends_at() const { return passed_at_ + timeout_ns_; }


 private:
  std::int64_t error() const;

  Nanos timeout_ns_;
  std::int64_t tolerance_mm_s_;
  std::int64_t progress_mm_s_;
  Wheels command_;
  Wheels measured_;
  //: Of the SIPs since the last new command. `begin` leaves it: the SIP that begins to drive is taken at once.
  std::int64_t least_error_{};
  Nanos passed_at_{};
};

//: The newest speeds, and when a VEL+RVEL pair goes out: on a change, not too near to the last, and again when old.
class CommandPacer {
 public:
  explicit CommandPacer(const Settings& settings)
      : spacing_ns_(settings.pair_spacing_ns), refresh_ns_(settings.refresh_ns) {}

  // Starts with a first pair that is due at once.
  void begin(Speeds speeds);

  // Returns when the next pair is due; `now` for at once.
  Nanos due_at(Nanos now) const;

  // Returns the speeds to send at `now`, as sent.
  Speeds take(Nanos now);

  Speeds sent() const { return sent_; }
  void want(Speeds speeds) { wanted_ = speeds; }

 private:
  Nanos spacing_ns_;
  Nanos refresh_ns_;
  Speeds wanted_;
  Speeds sent_;
  Nanos sent_at_{};
  bool has_sent_ = false;
};

}  // namespace adapter
