// The adapter on a BluePill: the same core, loop and wires, an STM32F103 in the ESP32's place.
//
// It exists to prove the core on silicon that we can emulate whole; it would drive a
// real robot through the same level shifter. One task, the rest is in interrupts.

#include <cstdint>

#include "../core/app/event_log.hpp"
#include "../core/app/runner.hpp"
#include "../generated/rev_b/pins.hpp"
#include "../generated/robots.hpp"
#include "hardware.hpp"
#include "registers.hpp"

//: What a debugger, or the bench's emulator, reads while the program runs.
struct Report {
  std::uint32_t passes;
  std::uint32_t longest_pass_cycles;
  std::uint32_t sips;
  std::uint32_t state;
  std::uint32_t losses;
  std::uint32_t rejected;
  std::uint32_t events;
};
extern "C" volatile Report adapter_report;
volatile Report adapter_report{};

extern "C" int main() {
  bluepill::start();
  bluepill::Clock clock;
  bluepill::Wires wires;
  bluepill::Uart uart;
  static app::EventLog log;
  adapter::Adapter part({}, *adapter::find_robot("p2dx"), board::WIRES, clock.now());
  part.attach(&wires, &wires, &log);
  app::Runner runner(part, clock, uart, nullptr);
  for (;;) {
    const std::uint64_t started = bluepill::cycles();
    runner.pass();
    const auto taken = static_cast<std::uint32_t>(bluepill::cycles() - started);
    const p2os::DecoderStats& line = part.client().wire_stats();
    adapter_report.passes = adapter_report.passes + 1;
    adapter_report.longest_pass_cycles =
        taken > adapter_report.longest_pass_cycles ? taken : adapter_report.longest_pass_cycles;
    adapter_report.sips = part.sips();
    adapter_report.state = static_cast<std::uint32_t>(part.state());
    adapter_report.losses = part.client().stats().losses;
    adapter_report.rejected = line.bad_checksums + line.bad_counts + bluepill::lost_bytes;
    adapter_report.events = log.count();
    // The tick of each millisecond ends the sleep, and so does a byte.
    bluepill::wait_for_interrupt();
  }
}
