#include "encoders.hpp"

#include "numbers.hpp"

namespace adapter {

namespace {

constexpr std::int32_t POSITION_MODULUS = 1 << 15;
//: The mean of two headings needs half a count.
constexpr std::int32_t HALF_COUNTS = 2 * HEADING_MODULUS;
constexpr std::int32_t QUARTER = HALF_COUNTS / 4;
constexpr int ONE_BITS = 30;
//: (2 pi / 4096)^2 / 24 in 2^-40: the arc's excess over its chord for one squared count of turn.
constexpr int ARC_BITS = 40;
constexpr std::int64_t ARC_E40 = 107'802;
//: Beyond a quarter of a turn between two packets the arc is anybody's guess.
constexpr std::int32_t MOST_TURN = HEADING_MODULUS / 4;
//: pi in 1e-9.
constexpr std::int64_t PI_E9 = 3'141'592'654;

// sin(k / 8192 turn) x 2^30, k = 0 to a quarter turn, rounded; the compiler works it out, no entry is near a tie.
struct Sines {
  std::int32_t at[QUARTER + 1];

  constexpr Sines() : at{} {
    for (std::int32_t k = 0; k <= QUARTER; ++k) {
      const double angle = 1.57079632679489661923 * k / QUARTER;
      double term = angle;
      double sum = 0;
      for (int n = 1; n < 24; n += 2) {
        sum += term;
        term *= -angle * angle / ((n + 1) * (n + 2));
      }
      at[k] = static_cast<std::int32_t>(sum * (std::int32_t{1} << ONE_BITS) + 0.5);
    }
  }
};
constexpr Sines SINE_TABLE;

std::int64_t floor_shift(std::int64_t value, int bits) { return divide_floor(value, std::int64_t{1} << bits); }

}  // namespace

std::int32_t Unwrapper::update(std::int32_t raw) {
  const auto value = static_cast<std::int32_t>(remainder_floor(raw, modulus_));
  if (!has_last_) {
    has_last_ = true;
    last_ = value;
    return 0;
  }
  const std::int32_t half = modulus_ / 2;
  const auto step = static_cast<std::int32_t>(remainder_floor(value - last_ + half, modulus_)) - half;
  last_ = value;
  return step;
}

std::int32_t sine(std::int32_t half_counts) {
  const auto angle = static_cast<std::int32_t>(remainder_floor(half_counts, HALF_COUNTS));
  const std::int32_t quadrant = angle / QUARTER;
  const std::int32_t within = (quadrant & 1) != 0 ? QUARTER - angle % QUARTER : angle % QUARTER;
  const std::int32_t value = SINE_TABLE.at[within];
  return (quadrant & 2) != 0 ? -value : value;
}

std::int64_t forward_step(std::int32_t dx, std::int32_t dy, std::int32_t heading_before, std::int32_t heading_after) {
  const std::int32_t mean = heading_before + heading_after;
  const std::int64_t chord =
      static_cast<std::int64_t>(dx) * sine(mean + QUARTER) + static_cast<std::int64_t>(dy) * sine(mean);
  const std::int64_t turn = heading_after - heading_before;
  if (size_of_number(turn) > MOST_TURN) {
    return chord;
  }
  return chord + floor_shift(floor_shift(chord, 20) * (turn * turn * ARC_E40), ARC_BITS - 20);
}

Encoders::Encoders(const RobotNumbers& robot, Nanos longest_gap_ns, std::int32_t width)
    : distance_nm_per_count_(robot.distance_nm_per_count),
      // mm/s x ns are 1e-9 mm, that is 1e-6 um.
      longest_counts_(robot.ceiling_mm_s * longest_gap_ns / 1'000'000 * 1'000 / robot.distance_nm_per_count),
      per_turn_nm_(divide_half_away(robot.wheel_diameter_um * PI_E9, 1'000'000)),
      rim_per_turn_nm_(divide_half_away(robot.track_mm * PI_E9, 1'000)),
      width_(width),
      x_(POSITION_MODULUS),
      y_(POSITION_MODULUS),
      turn_(HEADING_MODULUS) {}

void Encoders::begin(Wheels travel_nm) {
  x_.forget();
  y_.forget();
  turn_.forget();
  has_heading_ = false;
  heading_ = forward_ = 0;
  offset_nm_ = travel_nm;
}

bool Encoders::take(std::int32_t raw_x, std::int32_t raw_y, std::int32_t raw_heading) {
  const std::int32_t dx = x_.update(raw_x);
  const std::int32_t dy = y_.update(raw_y);
  const std::int32_t turn = turn_.update(raw_heading);
  const std::int32_t before = raw_heading_;
  const bool has_before = has_heading_;
  raw_heading_ = static_cast<std::int32_t>(remainder_floor(raw_heading, HEADING_MODULUS));
  has_heading_ = true;
  if (!has_before) {
    return true;
  }
  if (size_of_number(dx) > longest_counts_ || size_of_number(dy) > longest_counts_) {
    ++jumps_;
    return false;
  }
  forward_ += forward_step(dx, dy, before, before + turn);
  heading_ += turn;
  return true;
}

Wheels Encoders::travel_nm() const {
  const std::int64_t whole = floor_shift(forward_, ONE_BITS);
  const std::int64_t part = forward_ - whole * (std::int64_t{1} << ONE_BITS);
  const std::int64_t forward_nm =
      whole * distance_nm_per_count_ + floor_shift(part * distance_nm_per_count_, ONE_BITS);
  // One turn of the robot rolls each rim by pi x track; whole turns apart, so that 64 bits last for ever.
  const std::int64_t turns = divide_floor(heading_, HEADING_MODULUS);
  const std::int64_t counts = remainder_floor(heading_, HEADING_MODULUS);
  const std::int64_t rim_nm = turns * rim_per_turn_nm_ + divide_half_away(counts * rim_per_turn_nm_, HEADING_MODULUS);
  return {offset_nm_.left + forward_nm - rim_nm, offset_nm_.right + forward_nm + rim_nm};
}

Wheels Encoders::travel_nm_at(Wheels counts) const {
  const std::int64_t step = std::int64_t{1'000} << width_;
  return {-divide_floor(-counts.left * per_turn_nm_, step) * 1'000,
          -divide_floor(-counts.right * per_turn_nm_, step) * 1'000};
}

Wheels Encoders::phases_um() const {
  const Wheels travel = travel_nm();
  return {remainder_floor(travel.left, per_turn_nm_) / 1'000, remainder_floor(travel.right, per_turn_nm_) / 1'000};
}

Wheels Encoders::counts() const {
  const Wheels travel = travel_nm();
  const std::int64_t steps = std::int64_t{1} << width_;
  return {divide_floor(travel.left * steps, per_turn_nm_), divide_floor(travel.right * steps, per_turn_nm_)};
}

}  // namespace adapter
