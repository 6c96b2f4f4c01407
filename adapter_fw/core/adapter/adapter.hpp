// The adapter between a BluePill's pins and a Pioneer's P2OS line.
//
// A client of the robot, commanded by pins or by a game pad, never by both:
//
//     RESET       rst is high: outputs released to their pulls, nothing runs
//     BOOTING     rst fell (or power came): released still, for boot_ns
//     IDLE        outputs safe, waits for p2dx_con (or the pad's Up)
//     CONNECTING  the P2OS connection is being made; outputs safe
//     SETTLING    OPEN: SETO and SONAR 1 sent, waits for odometry zero; distances live
//     DRIVING     ENABLE 1 sent; motor values become VEL and RVEL; all live
//     CLOSING     the connect request was withdrawn: STOP, VEL 0, RVEL 0, CLOSE sent; lasts stop_repeat_ns
//     LOST        no SIP, implausible motion, no pad, a gap or a shutdown: the same four sent; waits for
//                 the connect request to be withdrawn
//
// From LOST the way to motion leads over a new connect request, whatever the robot does
// meanwhile. adapter_sim/adapter.py has the table of transitions; this is its twin,
// and a test drives both with the same pins, bytes and times.
//
// Invariant: within one instant the order is fixed: reset wire, boot, connection,
// sample, loss, plausibility, distances, encoders, speeds, stops.
#pragma once

#include <cstdint>

#include "../../hal/pins.hpp"
#include "../p2os/client.hpp"
#include "distances.hpp"
#include "driver.hpp"
#include "encoders.hpp"
#include "gamepad.hpp"
#include "inputs.hpp"
#include "mixing.hpp"
#include "outputs.hpp"
#include "settings.hpp"

namespace adapter {

enum class State : std::uint8_t { RESET, BOOTING, IDLE, CONNECTING, SETTLING, DRIVING, CLOSING, LOST };

//: What happened; the words are those of the Python model.
enum class What : std::uint8_t {
  RESET, BOOTING, BOOTED, CONNECTING, CONNECTED, NO_CONNECTION, DRIVING, COMMAND, STALL, ODOMETRY_JUMPED,
  DISCONNECTED, IDLE, LOST, IMPLAUSIBLE, PAD_LOST, MASTER, MASTER_WAITS, SHUTDOWN,
};
const char* text(State state);
const char* text(What what);
const char* text(Master master);

//: What is planned, and when; a reset clears it. NEVER where nothing is planned.
struct Agenda {
  Nanos boot_at = p2os::NEVER;
  //: Next try to connect, or end of CLOSING.
  Nanos retry_at = p2os::NEVER;
  Nanos sip_deadline = p2os::NEVER;
  //: From here on the odometry is taken as it is.
  Nanos settle_at = p2os::NEVER;
  //: SONAR 1 is sent again unless a reading comes before.
  Nanos sonar_at = p2os::NEVER;
  //: Of what is left of `stops_left`.
  Nanos stop_at{};
  //: When bytes of the robot came last.
  Nanos received_at = 0;
  std::int32_t stops_left = 0;
  std::int32_t enables_left = 0;
  std::uint32_t sips = 0;
  //: Whether the session ended because its master withdrew the connect request.
  bool is_closed_on_request = false;
  bool stall_left = false;
  bool stall_right = false;
};

//: Called at each transition.
class Observer {
 public:
  //: `detail` is a static string or the reason of a shutdown; the numbers depend on `what` (see adapter.cpp).
  virtual void happened(Nanos now, What what, const char* detail, std::int32_t first, std::int32_t second) = 0;

 protected:
  ~Observer() = default;
};

class Adapter final : private p2os::ClientListener {
 public:
  // Power comes at `now`. The settings must be without fault (settings.hpp).
  Adapter(const Settings& settings, const RobotNumbers& robot, const WireNumbers& wires, Nanos now);
  // A copy goes its own way from the same state; it has to be attached. An assignment keeps what is attached.
  Adapter(const Adapter& other);
  Adapter& operator=(const Adapter&) = default;

  // Where the wires are and who is notified; they must outlive the adapter.
  void attach(hal::PinsIn* in, hal::PinsOut* out, Observer* observer);

  // Takes bytes that arrived at `now`; what was due earlier is done first.
  void receive(p2os::Bytes data, Nanos now);
  // Takes a pad's report that came at `now`.
  void receive_pad(const PadReport& report, Nanos now);
  // Gives the robot to another master: stopped and closed first, and only a new connect request starts it.
  void set_master(Master master, Nanos now);
  // Stops the robot, drives every output to its safe level, and waits for the
  // connect request to be withdrawn. `reason` is static.
  void shutdown(const char* reason, Nanos now);
  // Leaves out the time up to `now`, in which nobody called: what was due in it is not done late, the robot is
  // stopped as by `shutdown`, and STOP is the next frame out. `reason` is static.
  void skip_to(const char* reason, Nanos now);

  // Says where the wheels stand within their turn, in um of the rim, as `wheel_phases_um` said before the power or
  // the program went; before the first `advance_to`.
  void place_wheels(Wheels phases_um);
  Wheels wheel_phases_um() const { return encoders_.phases_um(); }

  // Acts on everything due up to and including `limit`, then looks at rst.
  void advance_to(Nanos limit);
  Nanos next_deadline() const { return deadline_; }
  // Tells whether the samples to come change nothing that others see as long as the input wires show `word`, as they
  // do since the last `advance_to`: until `unsampled_deadline` nothing happens then. Duties change by their time-out too.
  bool is_settled(std::uint32_t word) const;
  // Returns the next deadline that is no sample; of a running adapter.
  Nanos unsampled_deadline() const;
  [[nodiscard]] bool take_output(p2os::CommandFrame& frame) { return client_.take_output(frame); }

  State state() const { return state_; }
  Master master() const { return master_; }
  const char* reason() const { return reason_; }
  // Puts another text in the place of the reason; for one who restores a state that another process saved.
  void set_reason(const char* reason) { reason_ = reason; }
  std::int32_t motor(int number) const;
  Speeds speeds() const { return pacer_.sent(); }
  Wheels travel_nm() const { return encoders_.travel_nm(); }
  Wheels counts() const { return encoders_.counts(); }
  Wheels counts_shown() const { return {left_walk_.shown(), right_walk_.shown()}; }
  std::uint32_t sips() const { return agenda_.sips; }
  std::uint32_t jumps() const { return encoders_.jumps(); }
  const Outputs& outputs() const { return outputs_; }
  const p2os::Client& client() const { return client_; }
  const p2os::Identity& robot() const { return identity_; }
  // Returns the line speed that is being tried or used.
  std::int32_t baud() const { return settings_.bauds[baud_]; }

 private:
  void session_opened(const p2os::Identity& robot, Nanos now) override;
  void session_ended(p2os::EndReason reason, Nanos now) override;
  void take_sip(const p2os::Sip& sip, Nanos now) override;

  Nanos run(Nanos limit);
  void act(Nanos now);
  void act_running(Nanos now);
  void run_open(Nanos now);
  void repeat_stop(Nanos now);
  void replan();
  void clear();
  void follow_reset(Nanos now);
  void boot(Nanos now);
  void stand_at(Wheels travel_nm);
  void begin_session(Nanos now, const char* why);
  void drive(Nanos now);
  void lose(What what, const char* why, Nanos now);
  void lose_pad(Nanos now);
  void end_request(const char* why, Nanos now);
  void halt(Nanos now);
  void sample(Nanos now);
  bool take_motors(std::uint32_t word, Nanos now);
  void walk(Nanos now);
  void send_pair(Nanos now);
  void next_baud();
  void enter(State state, Nanos now, What what, const char* why);
  void notify(Nanos now, What what, const char* detail, std::int32_t first = 0, std::int32_t second = 0);
  std::uint32_t read_pins(Nanos at) { return in_ ? in_->read(at) : 0; }
  bool is_reset_wire_high(Nanos at) { return (read_pins(at) >> reset_bit_ & 1U) != 0; }
  bool is_running() const { return state_ != State::RESET && state_ != State::BOOTING; }
  bool is_open() const { return state_ == State::SETTLING || state_ == State::DRIVING; }
  bool has_session() const { return is_open() || state_ == State::CONNECTING; }
  bool is_stopping() const { return state_ == State::CLOSING || state_ == State::LOST || state_ == State::IDLE; }
  bool wants_robot() const;
  Speeds wanted_speeds() const;

  p2os::UncopiedPointer<hal::PinsIn> in_;
  p2os::UncopiedPointer<Observer> observer_;

  Settings settings_;
  RobotNumbers robot_;
  WireNumbers wires_;
  std::int32_t reset_bit_;
  std::int32_t heading_scale_;
  Mixer mixer_;
  Distances distances_;
  Encoders encoders_;
  p2os::Client client_;
  Outputs outputs_;
  Majority majority_;
  Median left_duty_;
  Median right_duty_;
  Debounce connect_;
  Gamepad pad_;
  PlausibilityCheck plausibility_;
  CommandPacer pacer_;
  CodeWalk left_walk_;
  CodeWalk right_walk_;
  p2os::Identity identity_;

  State state_ = State::BOOTING;
  Master master_ = Master::BLUEPILL;
  const char* reason_ = "power";
  std::size_t baud_ = 0;
  Nanos now_;
  Nanos next_sample_;
  Nanos deadline_{};
  Agenda agenda_;
};

}  // namespace adapter
