#include "led.hpp"

namespace app {

namespace {

//: chosen: a flash that an eye can count, and a flicker that it cannot.
constexpr p2os::Nanos FLASH_NS = 100 * p2os::NS_PER_MS, FLICKER_NS = 50 * p2os::NS_PER_MS;

//: `count` flashes, each as long as the gap behind it.
bool flashes(p2os::Nanos place, p2os::Nanos count) {
  return place < 2 * count * FLASH_NS && place / FLASH_NS % 2 == 0;
}

}  // namespace

bool led_is_on(adapter::State state, adapter::Master master, p2os::Nanos now) {
  const p2os::Nanos place = now % LED_PERIOD_NS;
  switch (state) {
    case adapter::State::IDLE:
      return flashes(place, 1);
    case adapter::State::CONNECTING:
      return flashes(place, 2);
    case adapter::State::SETTLING:
      return flashes(place, 3);
    case adapter::State::CLOSING:
      return flashes(place, 4);
    case adapter::State::DRIVING:
      return master == adapter::Master::BLUEPILL || place >= FLASH_NS;
    case adapter::State::LOST:
      return place / FLICKER_NS % 2 == 0;
    default:
      return false;
  }
}

}  // namespace app
