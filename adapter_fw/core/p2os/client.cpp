#include "client.hpp"

namespace p2os {

namespace {

//: Sent by a controller that has just been reset.
constexpr std::uint8_t RESET_KINDS[] = {0xFE, 0xFF};
constexpr std::uint8_t IDENTITY_KIND = 2;

bool is_reset_notice(std::uint8_t kind) { return kind == RESET_KINDS[0] || kind == RESET_KINDS[1]; }

CommandFrame stop() { return CommandFrame(CommandNumber::STOP); }
CommandFrame stand_still(CommandNumber number) { return CommandFrame(number, 0); }

//: Copies a string that ends with NUL or with the data; returns what follows it.
Bytes read_text(Bytes data, std::array<char, Identity::LENGTH>& text) {
  text.fill('\0');
  std::size_t length = 0;
  while (length < data.size && data[length] != 0) {
    if (length + 1 < text.size()) {
      text[length] = static_cast<char>(data[length]);
    }
    ++length;
  }
  return data.from(length < data.size ? length + 1 : data.size);
}

}  // namespace

const char* text(EndReason reason) {
  switch (reason) {
    case EndReason::NO_ANSWER:
      return "no answer to SYNC0";
    case EndReason::SILENCE:
      return "no packet in time";
    case EndReason::CONTROLLER_RESET:
      return "the robot's controller was reset";
    case EndReason::RESTARTED:
      return "the robot was restarted";
  }
  return "";
}

void Client::connect(Nanos now) {
  if (state_ != ClientState::CLOSED && state_ != ClientState::LOST && state_ != ClientState::FAILED) {
    return;
  }
  attempts_ = 0;
  if (state_ == ClientState::LOST) {
    stop_and_close(now);
  } else {
    sync(ClientState::SYNC0, now);
  }
}

void Client::abandon() {
  drop();
  enqueue(stop());
  enqueue(stand_still(CommandNumber::VEL));
  enqueue(stand_still(CommandNumber::RVEL));
  enqueue(CommandFrame(CommandNumber::CLOSE));
}

void Client::drop() {
  enter(ClientState::CLOSED, NEVER);
  count_ = 0;
}

void Client::send(const CommandFrame& frame, Nanos now) {
  if (is_open()) {
    transmit(frame, now);
  }
}

void Client::stop_unknown() {
  if (settings_.stops_unknown_robot) {
    enqueue(stop());
    enqueue(stand_still(CommandNumber::VEL));
    enqueue(stand_still(CommandNumber::RVEL));
  }
}

void Client::receive(Bytes data, Nanos now) {
  advance_to(now);
  decoder_.receive(data, now, *this);
}

void Client::advance_to(Nanos limit) {
  for (Nanos due = next_deadline(); due <= limit; due = next_deadline()) {
    decoder_.advance_to(due, *this);
    act(due);
  }
}

Nanos Client::next_deadline() const {
  Nanos due = earlier(due_, decoder_.next_deadline());
  return is_open() ? earlier(due, last_sent_ns_ + settings_.pulse_ns) : due;
}

bool Client::take_output(CommandFrame& frame) {
  if (count_ == 0) {
    return false;
  }
  frame = output_[first_];
  first_ = (first_ + 1) % OUTPUT_FRAMES;
  --count_;
  return true;
}

void Client::take_frame(Bytes payload, Nanos now) {
  ++stats_.frames_received;
  if (is_open()) {
    take_open_packet(payload, now);
  } else if (is_syncing()) {
    take_answer(payload, now);
  } else {
    ++stats_.frames_ignored;
  }
}

void Client::take_answer(Bytes payload, Nanos now) {
  const std::uint8_t kind = payload[0];
  if (is_sip_kind(kind)) {
    stop_and_close(now);
    return;
  }
  if (is_reset_notice(kind)) {
    retry(now);
    return;
  }
  const auto awaited = static_cast<std::uint8_t>(static_cast<int>(state_) - static_cast<int>(ClientState::SYNC0));
  // Echoes are bare; only the robot's name carries data. A late echo of an earlier sync is no news.
  if (kind != awaited || (kind == IDENTITY_KIND) != (payload.size > 1)) {
    ++stats_.frames_ignored;
  } else if (state_ == ClientState::SYNC2) {
    read_text(read_text(read_text(payload.from(1), identity_.name), identity_.robot_class), identity_.subclass);
    enter(ClientState::SYNCED, now + settings_.open_delay_ns);
  } else {
    sync(state_ == ClientState::SYNC0 ? ClientState::SYNC1 : ClientState::SYNC2, now);
  }
}

void Client::take_open_packet(Bytes payload, Nanos now) {
  const std::uint8_t kind = payload[0];
  if (is_reset_notice(kind)) {
    lose(EndReason::CONTROLLER_RESET, now);
    return;
  }
  if (kind < IDENTITY_KIND && payload.size == 1) {
    // What a robot answers before OPEN. Echoes that were late came before the first packet.
    if (has_received_) {
      lose(EndReason::RESTARTED, now);
    } else {
      ++stats_.frames_ignored;
    }
    return;
  }
  has_received_ = true;
  due_ = now + settings_.liveness_ns;
  if (!is_sip_kind(kind)) {
    return;
  }
  Sip sip;
  if (!Sip::read(payload, sip)) {
    ++stats_.malformed;
  } else if (listener_) {
    listener_->take_sip(sip, now);
  }
}

void Client::act(Nanos now) {
  if (now >= due_) {
    time_out(now);
  }
  if (is_open() && now >= last_sent_ns_ + settings_.pulse_ns) {
    transmit(CommandFrame(CommandNumber::PULSE), now);
  }
}

void Client::time_out(Nanos now) {
  if (is_syncing()) {
    ++stats_.sync_timeouts;
    retry(now);
  } else if (state_ == ClientState::RECOVERING) {
    sync(ClientState::SYNC0, now);
  } else if (state_ == ClientState::SYNCED) {
    transmit(CommandFrame(CommandNumber::OPEN), now);
    enter(ClientState::OPEN, now + settings_.first_packet_ns);
    has_received_ = false;
    if (listener_) {
      listener_->session_opened(identity_, now);
    }
  } else {
    lose(EndReason::SILENCE, now);
  }
}

// Begins again at SYNC0, or gives up.
void Client::retry(Nanos now) {
  if (attempts_ < settings_.sync_attempts) {
    sync(ClientState::SYNC0, now);
    return;
  }
  enter(ClientState::FAILED, NEVER);
  if (listener_) {
    listener_->session_ended(EndReason::NO_ANSWER, now);
  }
}

void Client::sync(ClientState state, Nanos now) {
  if (state == ClientState::SYNC0) {
    ++attempts_;
    stop_unknown();
  }
  const int number = static_cast<int>(state) - static_cast<int>(ClientState::SYNC0);
  transmit(CommandFrame(static_cast<CommandNumber>(number)), now);
  enter(state, now + settings_.sync_timeout_ns);
}

// Brings a robot that is open, and may be moving, to a stand, closes it, and tries again.
void Client::stop_and_close(Nanos now) {
  transmit(stop(), now);
  transmit(stand_still(CommandNumber::VEL), now);
  transmit(CommandFrame(CommandNumber::CLOSE), now);
  if (attempts_ >= settings_.sync_attempts) {
    retry(now);
  } else {
    enter(ClientState::RECOVERING, now + settings_.close_wait_ns);
  }
}

void Client::lose(EndReason reason, Nanos now) {
  ++stats_.losses;
  transmit(stop(), now);
  transmit(stand_still(CommandNumber::VEL), now);
  enter(ClientState::LOST, NEVER);
  if (listener_) {
    listener_->session_ended(reason, now);
  }
}

void Client::enter(ClientState state, Nanos due) {
  state_ = state;
  due_ = due;
}

void Client::transmit(const CommandFrame& frame, Nanos now) {
  enqueue(frame);
  last_sent_ns_ = now;
}

void Client::enqueue(const CommandFrame& frame) {
  if (count_ == OUTPUT_FRAMES) {
    ++stats_.overflows;
    return;
  }
  output_[(first_ + count_) % OUTPUT_FRAMES] = frame;
  ++count_;
}

bool Client::is_syncing() const {
  return state_ == ClientState::SYNC0 || state_ == ClientState::SYNC1 || state_ == ClientState::SYNC2;
}

}  // namespace p2os
