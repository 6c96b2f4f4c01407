// The adapter's transitions: reset, session, loss.

#include "adapter.hpp"
#include "numbers.hpp"

namespace adapter {

using p2os::CommandFrame;
using p2os::CommandNumber;

namespace {

//: ENABLE 1 goes out with this many pairs: one frame may be lost. # chosen: not more, a person may switch the motors off
constexpr std::int32_t ENABLES = 2;

}  // namespace

void Adapter::clear() {
  agenda_ = {};
  majority_.reset();
  left_duty_.reset();
  right_duty_.reset();
  connect_.reset();
  pad_.lose();
  pacer_.begin({});
  // Absolute: where the wheels stand outlives a reset.
  encoders_.begin(encoders_.travel_nm());
  encoders_.forget_jumps();
  left_walk_.reset();
  right_walk_.reset();
  client_.forget();
  baud_ = 0;
}

// Follows the reset wire, whose level does not fit the state.
void Adapter::follow_reset(Nanos now) {
  if (state_ == State::RESET) {
    agenda_.boot_at = now + settings_.boot_ns;
    enter(State::BOOTING, now, What::BOOTING, "rst is low");
    return;
  }
  clear();
  outputs_.release(now);
  next_sample_ = now + settings_.sample_period_ns;
  enter(State::RESET, now, What::RESET, "rst is high");
}

void Adapter::boot(Nanos now) {
  outputs_.show_safe(now);
  outputs_.show_encoders(counts_shown(), now);
  client_.stop_unknown();
  next_sample_ = now;
  enter(State::IDLE, now, What::BOOTED, "waits for its master's connect request");
}

void Adapter::begin_session(Nanos now, const char* why) {
  agenda_.stops_left = 0;
  agenda_.retry_at = p2os::NEVER;
  client_.connect(now);
  enter(State::CONNECTING, now, What::CONNECTING, why);
}

void Adapter::session_opened(const p2os::Identity& robot, Nanos now) {
  identity_ = robot;
  client_.send(CommandFrame(CommandNumber::SETO), now);
  client_.send(CommandFrame(CommandNumber::SONAR, 1), now);
  agenda_.sip_deadline = now + settings_.first_sip_ns;
  agenda_.settle_at = now + settings_.settle_ns;
  agenda_.sonar_at = now + settings_.distance_stale_ns;
  distances_.forget();
  if (settings_.encoder_at_open == EncoderAtOpen::ZERO) {
    left_walk_.rebase(std::int64_t{1} << wires_.encoder_width);
    right_walk_.rebase(std::int64_t{1} << wires_.encoder_width);
    encoders_.begin({});
  } else {
    encoders_.begin(encoders_.travel_nm());
  }
  enter(State::SETTLING, now, What::CONNECTED, "waits for the odometry");
}

void Adapter::session_ended(p2os::EndReason reason, Nanos now) {
  if (state_ == State::CONNECTING) {
    client_.drop();
    agenda_.retry_at = now + settings_.retry_ns;
    next_baud();
    notify(now, What::NO_CONNECTION, p2os::text(reason), static_cast<std::int32_t>(settings_.retry_ns / NS_PER_MS));
  } else {
    lose(What::LOST, p2os::text(reason), now);
  }
}

void Adapter::take_sip(const p2os::Sip& sip, Nanos now) {
  ++agenda_.sips;
  // From when its bytes came: one that was found late, behind a false header, is as old as they are.
  agenda_.sip_deadline = p2os::later(now, agenda_.received_at + settings_.liveness_ns);
  for (std::uint8_t place = 0; place < sip.sonar_count; ++place) {
    const p2os::SonarReading reading = sip.sonar(place);
    distances_.take(reading.number, reading.raw_range * robot_.range_um_per_count, now);
  }
  if (sip.sonar_count != 0) {
    agenda_.sonar_at = now + settings_.distance_stale_ns;
    outputs_.show_distances(distances_.levels(), now);
  }
  if (state_ == State::SETTLING) {
    const bool is_at_origin = sip.raw_x == 0 && sip.raw_y == 0 && sip.raw_heading == 0;
    if (!is_at_origin && now < agenda_.settle_at) {
      return;
    }
    drive(now);
  }
  if (!encoders_.take(sip.raw_x, sip.raw_y, sip.raw_heading * heading_scale_)) {
    notify(now, What::ODOMETRY_JUMPED, "the step is no travel; counts go on from here");
  }
  const Wheels measured{divide_half_away(sip.raw_left_velocity * robot_.velocity_um_s_per_count, 1'000),
                        divide_half_away(sip.raw_right_velocity * robot_.velocity_um_s_per_count, 1'000)};
  plausibility_.take(measured, sip.stall_left || sip.stall_right, now);
  if (sip.stall_left != agenda_.stall_left || sip.stall_right != agenda_.stall_right) {
    agenda_.stall_left = sip.stall_left;
    agenda_.stall_right = sip.stall_right;
    notify(now, What::STALL, "", sip.stall_left ? 1 : 0, sip.stall_right ? 1 : 0);
  }
  walk(now);
}

void Adapter::drive(Nanos now) {
  agenda_.enables_left = ENABLES;
  pacer_.begin(wanted_speeds());
  plausibility_.begin(now);
  enter(State::DRIVING, now, What::DRIVING, "odometry is taken, motors enabled");
}

void Adapter::lose(What what, const char* why, Nanos now) {
  halt(now);
  pad_.forget_request();
  enter(State::LOST, now, what, why);
}

void Adapter::lose_pad(Nanos now) {
  const bool wanted = wants_robot();
  pad_.lose();
  if (wanted && has_session()) {
    lose(What::PAD_LOST, "no report of the pad in time", now);
  }
}

// The master no longer wants the robot.
void Adapter::end_request(const char* why, Nanos now) {
  if (has_session()) {
    halt(now);
    agenda_.is_closed_on_request = true;
    agenda_.retry_at = now + settings_.stop_repeat_ns;
    enter(State::CLOSING, now, What::DISCONNECTED, why);
  }
}

// Stops and closes the robot, and shows what is known: nothing.
void Adapter::halt(Nanos now) {
  client_.abandon();
  agenda_.is_closed_on_request = false;
  agenda_.stops_left = settings_.stop_repeats;
  agenda_.stop_at = now + settings_.stop_repeat_ns;
  pacer_.begin({});
  outputs_.show_safe(now);
}

void Adapter::next_baud() {
  baud_ = baud_ + 1 < MAX_BAUDS && settings_.bauds[baud_ + 1] > 0 ? baud_ + 1 : 0;
}

void Adapter::enter(State state, Nanos now, What what, const char* why) {
  state_ = state;
  reason_ = why;
  notify(now, what, why);
}

void Adapter::notify(Nanos now, What what, const char* detail, std::int32_t first, std::int32_t second) {
  if (observer_) {
    observer_->happened(now, what, detail, first, second);
  }
}

}  // namespace adapter
