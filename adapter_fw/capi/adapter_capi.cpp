#include "adapter_capi.h"

#include <cstring>
#include <new>

#include "../core/adapter/adapter.hpp"
#include "../core/adapter/fields.hpp"

namespace {

using adapter::Adapter;
using adapter::RobotNumbers;
using adapter::Settings;
using adapter::WireNumbers;

using adapter::Field;
using adapter::setting;
using adapter::setting_count;

#define FIELD(Owner, member) ADAPTER_FIELD(Owner, member)

constexpr Field<RobotNumbers> ROBOT[] = {
    FIELD(RobotNumbers, distance_nm_per_count), FIELD(RobotNumbers, angle_counts_per_turn),
    FIELD(RobotNumbers, velocity_um_s_per_count), FIELD(RobotNumbers, range_um_per_count),
    FIELD(RobotNumbers, track_mm), FIELD(RobotNumbers, wheel_diameter_um), FIELD(RobotNumbers, ceiling_mm_s),
    FIELD(RobotNumbers, max_velocity_mm_s), FIELD(RobotNumbers, max_rotation_deg_s),
    FIELD(RobotNumbers, half_sonar_range_um),
};

constexpr Field<WireNumbers> WIRES[] = {
    FIELD(WireNumbers, distances), FIELD(WireNumbers, motor1_width), FIELD(WireNumbers, motor2_width),
    FIELD(WireNumbers, encoder_width), FIELD(WireNumbers, safe_mask), FIELD(WireNumbers, safe_levels),
    FIELD(WireNumbers, released_codes),
};

constexpr const char* STATUS[] = {
    "motor1", "motor2", "forward_mm_s", "turn_deg_s", "left_count", "right_count", "left_shown", "right_shown",
    "left_travel_nm", "right_travel_nm", "sips", "jumps", "driven", "levels", "baud", "master", "frames", "noise_bytes", "bad_checksums", "bad_counts",
    "stalled", "rescued", "frames_received", "frames_ignored", "malformed", "sync_timeouts",
    "losses", "overflows",
};

template <typename Owner, std::size_t SIZE>
const char* name_at(const Field<Owner> (&fields)[SIZE], std::int32_t place) {
  return place >= 0 && static_cast<std::size_t>(place) < SIZE ? fields[place].name : nullptr;
}

template <typename Owner, std::size_t SIZE>
Owner read(const Field<Owner> (&fields)[SIZE], const std::int64_t* values) {
  Owner owner{};
  for (std::size_t place = 0; place < SIZE; ++place) {
    fields[place].set(owner, values[place]);
  }
  return owner;
}

//: The word of the input wires that was read last.
struct Reading {
  std::uint32_t word;
  //: From when on it is known to stand there, and until before when.
  std::int64_t from;
  std::int64_t until;
  //: Whether it stands there until somebody says that a wire changes.
  bool is_suspended;
};

//: A saved state: the adapter's members and the text of its reason, which is no pointer that another process has.
struct State {
  alignas(Adapter) unsigned char bytes[sizeof(Adapter)];
  char reason[96];
  Reading reading;
};

}  // namespace

struct adapter_handle final : private hal::PinsIn, private hal::PinsOut, private adapter::Observer {
  adapter_handle(const Settings& settings, const RobotNumbers& robot, const WireNumbers& wires,
                 const adapter_callbacks& calls, std::int64_t now)
      : callbacks(calls), part(settings, robot, wires, now) {
    part.attach(this, this, this);
  }

  std::uint32_t read(p2os::Nanos at) override {
    if (at < reading.from || at >= reading.until) {
      reading.word = callbacks.read(callbacks.user, at);
      reading.from = at;
      reading.until = at + 1;
    }
    return reading.word;
  }

  // Begins what is done at `now`: the wires may have changed there, and before only where nobody waits for edges.
  Adapter& at(std::int64_t now) {
    reading.until = reading.is_suspended ? now : reading.from;
    reading.is_suspended = false;
    return part;
  }

  std::int32_t duty(std::int32_t bit, p2os::Nanos at) override { return callbacks.duty(callbacks.user, bit, at); }
  void drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos now) override {
    callbacks.drive(callbacks.user, mask, levels, now);
  }
  void release(p2os::Nanos now) override { callbacks.drive(callbacks.user, 0, 0, now); }
  void happened(p2os::Nanos now, adapter::What what, const char* detail, std::int32_t first,
                std::int32_t second) override {
    callbacks.happened(callbacks.user, now, adapter::text(what), detail, first, second);
  }

  adapter_callbacks callbacks;
  Adapter part;
  Reading reading{};
  bool waits_for_edges = false;
  State scratch{};
};

int32_t adapter_version(void) { return ADAPTER_CAPI_VERSION; }

adapter_handle* adapter_new(const int64_t* settings, const int64_t* robot, const int64_t* wires,
                            const adapter_callbacks* callbacks, int64_t now, const char** fault) {
  Settings set;
  for (std::int32_t place = 0; place < setting_count(); ++place) {
    setting(place).set(set, settings[place]);
  }
  const RobotNumbers numbers = read(ROBOT, robot);
  const WireNumbers board = read(WIRES, wires);
  *fault = adapter::fault_of(board);
  if (*fault == nullptr) {
    *fault = adapter::fault_of(set, board);
  }
  if (*fault == nullptr) {
    *fault = adapter::fault_of(numbers);
  }
  if (*fault != nullptr) {
    return nullptr;
  }
  auto* handle = new (std::nothrow) adapter_handle(set, numbers, board, *callbacks, now);
  if (handle == nullptr) {
    *fault = "no memory";
  }
  return handle;
}

void adapter_free(adapter_handle* handle) { delete handle; }

const char* adapter_setting_name(int32_t place) {
  return place >= 0 && place < setting_count() ? setting(place).name : nullptr;
}
const char* adapter_robot_name(int32_t place) { return name_at(ROBOT, place); }
const char* adapter_wire_name(int32_t place) { return name_at(WIRES, place); }

void adapter_receive(adapter_handle* handle, const uint8_t* data, size_t size, int64_t now) {
  handle->at(now).receive({data, size}, now);
}

void adapter_receive_pad(adapter_handle* handle, int32_t buttons, int32_t forward, int32_t backward, int32_t turn,
                         int64_t now) {
  handle->at(now).receive_pad({(buttons & 1) != 0, (buttons & 2) != 0, forward, backward, turn}, now);
}

void adapter_set_master(adapter_handle* handle, int32_t master, int64_t now) {
  handle->at(now).set_master(master == 0 ? adapter::Master::BLUEPILL : adapter::Master::PAD, now);
}

void adapter_shutdown(adapter_handle* handle, const char* reason, int64_t now) {
  std::strncpy(handle->scratch.reason, reason, sizeof handle->scratch.reason - 1);
  handle->at(now).shutdown(handle->scratch.reason, now);
}

void adapter_advance_to(adapter_handle* handle, int64_t limit) {
  handle->at(limit).advance_to(limit);
  handle->reading.is_suspended = handle->waits_for_edges && handle->part.is_settled(handle->read(limit));
}

int64_t adapter_next_deadline(const adapter_handle* handle) {
  return handle->reading.is_suspended ? handle->part.unsampled_deadline() : handle->part.next_deadline();
}

void adapter_wait_for_edges(adapter_handle* handle) { handle->waits_for_edges = true; }
int32_t adapter_is_suspended(const adapter_handle* handle) { return handle->reading.is_suspended ? 1 : 0; }

size_t adapter_take_output(adapter_handle* handle, uint8_t* frame) {
  p2os::CommandFrame next;
  if (!handle->part.take_output(next)) {
    return 0;
  }
  std::memcpy(frame, next.bytes().data, next.bytes().size);
  return next.bytes().size;
}

const char* adapter_status_name(int32_t place) {
  return place >= 0 && static_cast<std::size_t>(place) < sizeof STATUS / sizeof STATUS[0] ? STATUS[place] : nullptr;
}

void adapter_status(const adapter_handle* handle, int64_t* values) {
  const Adapter& part = handle->part;
  const p2os::DecoderStats& wire = part.client().wire_stats();
  const p2os::ClientStats& client = part.client().stats();
  const std::int64_t status[] = {
      part.motor(1), part.motor(2), part.speeds().forward_mm_s, part.speeds().turn_deg_s, part.counts().left,
      part.counts().right, part.counts_shown().left, part.counts_shown().right, part.travel_nm().left, part.travel_nm().right, part.sips(), part.jumps(),
      part.outputs().driven(), part.outputs().levels(), part.baud(), static_cast<std::int64_t>(part.master()),
      wire.frames, wire.noise_bytes, wire.bad_checksums, wire.bad_counts, wire.stalled, wire.rescued,
      client.frames_received, client.frames_ignored, client.malformed, client.sync_timeouts, client.losses,
      client.overflows,
  };
  static_assert(sizeof status / sizeof status[0] == sizeof STATUS / sizeof STATUS[0], "one value a name");
  std::memcpy(values, status, sizeof status);
}

const char* adapter_state(const adapter_handle* handle) { return adapter::text(handle->part.state()); }
const char* adapter_reason(const adapter_handle* handle) { return handle->part.reason(); }

const char* adapter_robot_text(const adapter_handle* handle, int32_t place) {
  const p2os::Identity& robot = handle->part.robot();
  return place == 0 ? robot.name.data() : place == 1 ? robot.robot_class.data() : robot.subclass.data();
}

size_t adapter_state_size(void) { return sizeof(State); }

void adapter_save(const adapter_handle* handle, void* state) {
  auto* saved = static_cast<State*>(state);
  std::memset(saved, 0, sizeof *saved);
  std::memcpy(saved->bytes, static_cast<const void*>(&handle->part), sizeof handle->part);
  std::strncpy(saved->reason, handle->part.reason(), sizeof saved->reason - 1);
  saved->reading = handle->reading;
}

void adapter_restore(adapter_handle* handle, const void* state) {
  std::memcpy(&handle->scratch, state, sizeof handle->scratch);
  // Member by member: what an object's own process put into it (its tables, its connections) is left out.
  handle->part = *reinterpret_cast<const Adapter*>(handle->scratch.bytes);
  handle->part.set_reason(handle->scratch.reason);
  handle->reading = handle->scratch.reading;
}
