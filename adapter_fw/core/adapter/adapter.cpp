// The adapter in time: construction, deadlines, and the work of one instant.

#include "adapter.hpp"

#include "numbers.hpp"

namespace adapter {

using p2os::CommandFrame;
using p2os::CommandNumber;
using p2os::earlier;
using p2os::later;

namespace {

//: A robot whose bytes came so recently is still streaming: one SIP period.
constexpr Nanos STREAMING_NS = 100 * NS_PER_MS;

p2os::ClientSettings client_settings(const Settings& settings) {
  p2os::ClientSettings client;
  client.pulse_ns = settings.pulse_ns;
  client.liveness_ns = settings.liveness_ns;
  client.first_packet_ns = settings.first_sip_ns;
  client.stops_unknown_robot = settings.stop_unknown_robot;
  return client;
}

}  // namespace

Adapter::Adapter(const Settings& settings, const RobotNumbers& robot, const WireNumbers& wires, Nanos now)
    : settings_(settings),
      robot_(robot),
      wires_(wires),
      reset_bit_(wires.motor1_width + wires.motor2_width + 1),
      heading_scale_(static_cast<std::int32_t>(HEADING_MODULUS / robot.angle_counts_per_turn)),
      mixer_(settings, robot, std::int64_t{1} << (wires.motor1_width - 1)),
      distances_(wires.distances, settings.threshold_um < 0 ? robot.half_sonar_range_um : settings.threshold_um,
                 settings.distance_stale_ns),
      encoders_(robot, settings.liveness_ns, wires.encoder_width),
      client_(client_settings(settings)),
      outputs_(wires),
      majority_(settings.sample_count),
      left_duty_(settings.sample_count),
      right_duty_(settings.sample_count),
      connect_(settings.connect_after_ns, settings.disconnect_after_ns),
      pad_(settings),
      plausibility_(settings),
      pacer_(settings),
      left_walk_(settings.encoder_dwell_ns),
      right_walk_(settings.encoder_dwell_ns),
      now_(now),
      next_sample_(now) {
  client_.set_listener(this);
  // Of a wheel that nobody knows of the code that its wires show already: a jump would be counted as travel.
  const std::int64_t steps = std::int64_t{1} << wires_.encoder_width;
  stand_at(encoders_.travel_nm_at({wires_.released_codes % steps, wires_.released_codes / steps}));
  clear();
  agenda_.boot_at = now + settings_.boot_ns;
  replan();
}

Adapter::Adapter(const Adapter& other) : Adapter(other.settings_, other.robot_, other.wires_, 0) { *this = other; }

void Adapter::attach(hal::PinsIn* in, hal::PinsOut* out, Observer* observer) {
  in_.set(in);
  outputs_.set_pins(out);
  observer_.set(observer);
}

void Adapter::receive(p2os::Bytes data, Nanos now) {
  run(now - 1);
  if (is_running()) {
    now_ = agenda_.received_at = now;
    client_.receive(data, now);
    replan();
  }
}

void Adapter::receive_pad(const PadReport& report, Nanos now) {
  run(now - 1);
  now_ = later(now_, now);
  const bool wanted = wants_robot();
  pad_.take(report, now);
  if (master_ == Master::PAD && is_running()) {
    if (wanted && !wants_robot()) {
      end_request("Down was pressed", now);
    }
    if (state_ == State::DRIVING) {
      pacer_.want(wanted_speeds());
    }
  }
  replan();
}

void Adapter::set_master(Master master, Nanos now) {
  run(now - 1);
  now_ = later(now_, now);
  if (master == master_) {
    return;
  }
  if (has_session()) {
    halt(now);
  }
  master_ = master;
  pad_.lose();
  notify(now, What::MASTER, text(master));
  if (is_running()) {
    enter(State::LOST, now, What::MASTER_WAITS, "waits for a new connect request of the new master");
  }
  replan();
}

void Adapter::shutdown(const char* reason, Nanos now) {
  run(now - 1);
  now_ = later(now_, now);
  if (is_running()) {
    lose(What::SHUTDOWN, reason, now);
    replan();
  }
}

void Adapter::skip_to(const char* reason, Nanos now) {
  now_ = later(now_, now);
  next_sample_ = later(next_sample_, now);
  if (is_running()) {
    lose(What::LOST, reason, now);
  }
  replan();
}

void Adapter::place_wheels(Wheels phases_um) { stand_at({phases_um.left * 1'000, phases_um.right * 1'000}); }

void Adapter::stand_at(Wheels travel_nm) {
  encoders_.begin(travel_nm);
  left_walk_.stand_at(encoders_.counts().left);
  right_walk_.stand_at(encoders_.counts().right);
}

void Adapter::advance_to(Nanos limit) {
  if (run(limit) == limit) {
    return;
  }
  now_ = later(now_, limit);
  if (is_reset_wire_high(limit) != (state_ == State::RESET)) {
    follow_reset(limit);
    replan();
  }
}

std::int32_t Adapter::motor(int number) const {
  if (settings_.motor_command == MotorCommand::DUTY) {
    return number == 1 ? left_duty_.value() : right_duty_.value();
  }
  const std::uint32_t word = majority_.word();
  const std::uint32_t first = (1U << wires_.motor1_width) - 1;
  const std::uint32_t second = (1U << wires_.motor2_width) - 1;
  return number == 1 ? motor_value(word & first, wires_.motor1_width, settings_.bit_order)
                     : motor_value(word >> wires_.motor1_width & second, wires_.motor2_width, settings_.bit_order);
}

// Time. ------------------------------------------------------------------------------------------------------

// Acts on all that is due; returns the last instant at which it did, -1 for none.
Nanos Adapter::run(Nanos limit) {
  Nanos acted_at = -1;
  while (deadline_ <= limit) {
    acted_at = deadline_;
    act(acted_at);
    replan();
  }
  return acted_at;
}

void Adapter::act(Nanos now) {
  now_ = now;
  if (is_reset_wire_high(now) != (state_ == State::RESET)) {
    follow_reset(now);
  }
  if (state_ == State::RESET || (state_ == State::BOOTING && now < agenda_.boot_at)) {
    next_sample_ = now + settings_.sample_period_ns;
    return;
  }
  if (state_ == State::BOOTING) {
    boot(now);
  }
  act_running(now);
}

void Adapter::act_running(Nanos now) {
  client_.advance_to(now);
  if (now >= next_sample_) {
    sample(now);
    next_sample_ = now + settings_.sample_period_ns;
  }
  if (master_ == Master::PAD && now >= pad_.lost_at()) {
    lose_pad(now);
  }
  if (is_open()) {
    run_open(now);
  }
  if (is_stopping() && agenda_.stops_left > 0 && now >= agenda_.stop_at) {
    repeat_stop(now);
  }
  if (state_ == State::CLOSING && now >= agenda_.retry_at) {
    enter(State::IDLE, now, What::IDLE, "closed");
  }
  if (state_ == State::IDLE && wants_robot()) {
    begin_session(now, master_ == Master::PAD ? "Up was pressed" : "p2dx_con is high");
  }
  if (state_ == State::CONNECTING && now >= agenda_.retry_at) {
    begin_session(now, "trying again");
  }
}

void Adapter::run_open(Nanos now) {
  if (now >= agenda_.sip_deadline) {
    lose(What::LOST, "no SIP in time", now);
    return;
  }
  if (state_ == State::DRIVING && now >= plausibility_.ends_at()) {
    lose(What::IMPLAUSIBLE, "the wheels do not follow, and no stall flag", now);
    return;
  }
  if (now >= distances_.expires_at()) {
    distances_.expire(now);
    outputs_.show_distances(distances_.levels(), now);
  }
  if (now >= agenda_.sonar_at) {
    // No reading for as long as one is valid: SONAR 1 was lost, or somebody switched them off.
    client_.send(CommandFrame(CommandNumber::SONAR, 1), now);
    agenda_.sonar_at = now + settings_.distance_stale_ns;
  }
  walk(now);
  if (state_ == State::DRIVING && now >= pacer_.due_at(now)) {
    send_pair(now);
  }
}

// Sends the stop sequence again: nobody has confirmed it; a robot closed on request does so by its silence.
void Adapter::repeat_stop(Nanos now) {
  --agenda_.stops_left;
  agenda_.stop_at = now + settings_.stop_repeat_ns;
  if (!agenda_.is_closed_on_request || now - agenda_.received_at < STREAMING_NS) {
    client_.abandon();
  }
}

void Adapter::replan() {
  if (!is_running()) {
    deadline_ = earlier(agenda_.boot_at, next_sample_);
    return;
  }
  deadline_ = earlier(next_sample_, unsampled_deadline());
}

Nanos Adapter::unsampled_deadline() const {
  Nanos due = client_.next_deadline();
  if (is_open()) {
    const Wheels counts = encoders_.counts();
    due = earlier(due, earlier(agenda_.sip_deadline, agenda_.sonar_at));
    due = earlier(due, distances_.expires_at());
    due = earlier(due, left_walk_.due_at(counts.left, now_));
    due = earlier(due, right_walk_.due_at(counts.right, now_));
  }
  if (state_ == State::DRIVING) {
    due = earlier(due, earlier(plausibility_.ends_at(), pacer_.due_at(now_)));
  }
  if (is_stopping() && agenda_.stops_left > 0) {
    due = earlier(due, agenda_.stop_at);
  }
  if (state_ == State::CLOSING || state_ == State::CONNECTING) {
    due = earlier(due, agenda_.retry_at);
  }
  if (master_ == Master::PAD) {
    due = earlier(due, pad_.lost_at());
  }
  return due;
}

bool Adapter::is_settled(std::uint32_t word) const {
  const std::uint32_t connect_bit = 1U << (reset_bit_ - 1);
  const bool leaves_by_request = wants_robot() ? state_ == State::IDLE : state_ == State::LOST;
  return is_running() && !leaves_by_request && settings_.motor_command == MotorCommand::BITS &&
         connect_.level() == ((word & connect_bit) != 0) && majority_.word() == (word & (connect_bit - 1));
}

// Work. ------------------------------------------------------------------------------------------------------

void Adapter::sample(Nanos now) {
  const std::uint32_t word = read_pins(now);
  const std::uint32_t connect_bit = 1U << (reset_bit_ - 1);
  const bool motors_changed = take_motors(word & (connect_bit - 1), now);
  const bool connect_changed = connect_.take((word & connect_bit) != 0, now);
  // Of the master, whoever it is: a pad wants what it wanted before.
  if (motors_changed && state_ == State::DRIVING) {
    pacer_.want(wanted_speeds());
  }
  if (connect_changed && master_ == Master::BLUEPILL && !wants_robot()) {
    end_request("p2dx_con is low", now);
  }
  if (state_ == State::LOST && !wants_robot()) {
    enter(State::IDLE, now, What::IDLE, "ready for a new connection");
  }
}

// Takes a sample of the motor wires; tells whether the values taken have changed.
bool Adapter::take_motors(std::uint32_t word, Nanos now) {
  if (settings_.motor_command == MotorCommand::BITS) {
    return majority_.take(word);
  }
  const auto signed_duty = [&](std::int32_t first, std::int32_t width) {
    const std::int32_t duty = in_ ? in_->duty(first, now) : 0;
    return (word >> (first + width - 1) & 1U) != 0 ? -duty : duty;
  };
  const bool left_changed = left_duty_.take(signed_duty(0, wires_.motor1_width));
  const bool right_changed = right_duty_.take(signed_duty(wires_.motor1_width, wires_.motor2_width));
  return left_changed || right_changed;
}

void Adapter::walk(Nanos now) {
  const Wheels counts = encoders_.counts();
  left_walk_.step(counts.left, now);
  right_walk_.step(counts.right, now);
  outputs_.show_encoders(counts_shown(), now);
}

void Adapter::send_pair(Nanos now) {
  const Speeds before = pacer_.sent();
  const Speeds speeds = pacer_.take(now);
  if (agenda_.enables_left > 0) {
    --agenda_.enables_left;
    client_.send(CommandFrame(CommandNumber::ENABLE, 1), now);
  }
  client_.send(CommandFrame(CommandNumber::VEL, speeds.forward_mm_s), now);
  client_.send(CommandFrame(CommandNumber::RVEL, speeds.turn_deg_s), now);
  plausibility_.expect(mixer_.wheels_mm_s(speeds));
  if (speeds != before) {
    notify(now, What::COMMAND, "", speeds.forward_mm_s, speeds.turn_deg_s);
  }
}

bool Adapter::wants_robot() const { return master_ == Master::PAD ? pad_.wants_robot() : connect_.level(); }

Speeds Adapter::wanted_speeds() const {
  return master_ == Master::PAD ? mixer_.steer(pad_.forward(), pad_.turn()) : mixer_.mix(motor(1), motor(2));
}

}  // namespace adapter
