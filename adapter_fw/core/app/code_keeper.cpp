#include "code_keeper.hpp"

#include <initializer_list>

namespace app {

namespace {

constexpr char NAME[] = "wheel_phases_um";
//: Both in one number, so that a power cut cannot leave one new and one old.
constexpr int HALF_BITS = 32;
//: Longer than any rim that settings.cpp lets pass.
constexpr std::int64_t LONGEST_UM = std::int64_t{1} << 31;
constexpr std::uint32_t FNV_OFFSET = 2'166'136'261U, FNV_PRIME = 16'777'619U;

bool is_phase(std::int64_t value) { return value >= 0 && value < LONGEST_UM; }

// FNV-1a over both numbers; no memory that has lost its power holds it by chance.
std::uint32_t check_of(const RetainedWheels& memory) {
  std::uint32_t hash = FNV_OFFSET;
  for (const std::int64_t value : {memory.left_um, memory.right_um}) {
    for (int shift = 0; shift < 64; shift += 8) {
      hash = (hash ^ static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> shift)) * FNV_PRIME;
    }
  }
  return hash;
}

}  // namespace

void CodeKeeper::restore(adapter::Adapter& part) {
  std::int64_t both{};
  adapter::Wheels kept{-1, -1};
  if (memory_.check == check_of(memory_) && is_phase(memory_.left_um) && is_phase(memory_.right_um)) {
    kept = {memory_.left_um, memory_.right_um};
  } else if (store_.load(NAME, both) && both >= 0) {
    kept = {both >> HALF_BITS, both % (std::int64_t{1} << HALF_BITS)};
  }
  if (is_phase(kept.left) && is_phase(kept.right)) {
    part.place_wheels(kept);
  }
  last_ = part.wheel_phases_um();
  remember(last_);
}

void CodeKeeper::keep(const adapter::Adapter& part, p2os::Nanos now) {
  const adapter::Wheels phases_um = part.wheel_phases_um();
  if (!(phases_um == last_)) {
    last_ = phases_um;
    since_ = now;
    is_stored_ = false;
    remember(phases_um);
  } else if (!is_stored_ && now - since_ >= STANDS_NS) {
    // A store that refuses is asked again after the next motion, not a thousand times a second.
    is_stored_ = true;
    static_cast<void>(store_.save(NAME, last_.left << HALF_BITS | last_.right));
  }
}

void CodeKeeper::remember(adapter::Wheels phases_um) {
  memory_.left_um = phases_um.left;
  memory_.right_um = phases_um.right;
  memory_.check = check_of(memory_);
}

}  // namespace app
