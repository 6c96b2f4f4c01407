// A P2OS client as a passive state machine: bytes and time in, events and frames out.
//
// Theory of operation. 0, 1 and 2 are SYNC0, SYNC1 and SYNC2 while the two ends
// find each other, and PULSE, OPEN and CLOSE once the session is open. The client
// sends SYNC0 until it is echoed, then SYNC1, then SYNC2, which the robot answers
// with its name; OPEN follows 100 ms later, and from then on packets flow.
//
//     CLOSED, LOST, FAILED  --connect-->  SYNC0 --> SYNC1 --> SYNC2 --> SYNCED --> OPEN
//     any SYNC  --a SIP comes: the robot is still open-->  RECOVERING  --200 ms-->  SYNC0
//     any SYNC  --no answer in 1 s-->  SYNC0 again, at most sync_attempts times, then FAILED
//     OPEN      --no packet for liveness_ns, a reset notice, an echo of SYNC-->  LOST
//
// P2OS acknowledges nothing, and any packet revives the last speed of a robot that
// its watchdog has stopped. So STOP, VEL 0 and RVEL 0 stand before every SYNC0
// (unless stops_unknown_robot is off), and STOP, VEL 0 before every CLOSE.
//
// A PULSE goes out when nothing else did for pulse_ns; the robot's watchdog stops it
// after 2 s. No heap, no exceptions, no clock.
#pragma once

#include <array>
#include <cstdint>

#include "decoder.hpp"
#include "frame.hpp"
#include "uncopied_pointer.hpp"
#include "sip.hpp"
#include "time.hpp"
#include "times.hpp"

namespace p2os {

//: The client's times; those of the robot are in the manuals.
struct ClientSettings {
  Nanos sync_timeout_ns = SYNC_TIMEOUT_NS;
  std::int32_t sync_attempts = SYNC_ATTEMPTS;
  Nanos close_wait_ns = CLOSE_WAIT_NS;
  Nanos open_delay_ns = OPEN_DELAY_NS;
  Nanos pulse_ns = PULSE_NS;
  Nanos first_packet_ns = FIRST_PACKET_NS;
  Nanos liveness_ns = LIVENESS_NS;
  bool stops_unknown_robot = true;
};

enum class ClientState : std::uint8_t { CLOSED, SYNC0, SYNC1, SYNC2, SYNCED, OPEN, RECOVERING, LOST, FAILED };

//: Why a session ended; `text` gives it in words.
enum class EndReason : std::uint8_t { NO_ANSWER, SILENCE, CONTROLLER_RESET, RESTARTED };
const char* text(EndReason reason);

//: What the robot answered to SYNC2; cut to 19 characters each, as other clients do.
struct Identity {
  static constexpr std::size_t LENGTH = 20;
  std::array<char, LENGTH> name{};
  std::array<char, LENGTH> robot_class{};
  std::array<char, LENGTH> subclass{};
};

//: Called with what happens, in order.
class ClientListener {
 public:
  //: OPEN was sent to a robot that has identified itself.
  virtual void session_opened(const Identity& robot, Nanos now) = 0;
  //: The session was lost (STOP and VEL 0 are the next frames out), or could not be opened.
  virtual void session_ended(EndReason reason, Nanos now) = 0;
  virtual void take_sip(const Sip& sip, Nanos now) = 0;

 protected:
  ~ClientListener() = default;
};

struct ClientStats {
  std::uint32_t frames_received = 0;
  std::uint32_t frames_ignored = 0;
  //: SIPs shorter than their own sonar count requires.
  std::uint32_t malformed = 0;
  std::uint32_t sync_timeouts = 0;
  std::uint32_t losses = 0;
  //: Frames that found the output full: nobody took it.
  std::uint32_t overflows = 0;
};

class Client final : private FrameSink {
 public:
  explicit Client(const ClientSettings& settings) : settings_(settings) {}

  // Who is notified; must outlive the client.
  void set_listener(ClientListener* listener) { listener_.set(listener); }

  ClientState state() const { return state_; }
  bool is_open() const { return state_ == ClientState::OPEN; }
  const ClientStats& stats() const { return stats_; }
  const DecoderStats& wire_stats() const { return decoder_.stats(); }

  // Begins to open a session; without effect while one is open or being opened.
  void connect(Nanos now);

  // Sends STOP, VEL 0, RVEL 0 and CLOSE; what was not taken yet is never sent.
  void abandon();

  // Ends the session without sending anything, and forgets what was not taken.
  void drop();

  // Forgets everything, as after a reset; the listener stays.
  void forget() { *this = Client(settings_); }

  // Sends a command of the open session; without effect while none is open.
  void send(const CommandFrame& frame, Nanos now);

  // Sends STOP, VEL 0, RVEL 0 to a robot of which nothing is known, unless the settings forbid it.
  void stop_unknown();

  // Takes bytes that arrived at `now`.
  void receive(Bytes data, Nanos now);

  // Acts on every deadline up to `limit`.
  void advance_to(Nanos limit);
  Nanos next_deadline() const;

  // Takes the oldest frame that has to go out; false when there is none.
  [[nodiscard]] bool take_output(CommandFrame& frame);

 private:
  //: chosen: six tries to synchronise with their stop sequences, twice over.
  static constexpr std::size_t OUTPUT_FRAMES = 64;

  void take_frame(Bytes payload, Nanos now) override;
  void take_answer(Bytes payload, Nanos now);
  void take_open_packet(Bytes payload, Nanos now);
  void act(Nanos now);
  void time_out(Nanos now);
  void retry(Nanos now);
  void sync(ClientState state, Nanos now);
  void stop_and_close(Nanos now);
  void lose(EndReason reason, Nanos now);
  void enter(ClientState state, Nanos due);
  void transmit(const CommandFrame& frame, Nanos now);
  void enqueue(const CommandFrame& frame);
  bool is_syncing() const;

  ClientSettings settings_;
  UncopiedPointer<ClientListener> listener_;
  Decoder decoder_;
  ClientState state_ = ClientState::CLOSED;
  //: When the present state runs out.
  Nanos due_ = NEVER;
  Nanos last_sent_ns_{};
  std::int32_t attempts_{};
  //: Whether a packet has come since OPEN.
  bool has_received_ = false;
  Identity identity_;
  ClientStats stats_;
  std::array<CommandFrame, OUTPUT_FRAMES> output_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace p2os
