// An STM32F103 as the adapter's hardware: clock of cycles, wires, and USART1 as the line to the robot.
//
// Pins. All eight inputs stand on one port, so that one read of IDR is an instant:
//
//     PB8 PB9 PB10     motor1_comm1..3        PA0 ... PA7     DD1 ... DD8
//     PB11 PB12 PB13   motor2_comm1..3        PB0 PB1 PB3     encoder1_s1..3
//     PB14             p2dx_con               PB4 PB5 PB6     encoder2_s1..3
//     PB15             rst                    PA9 PA10        TX, RX of the P2OS line
//
// Theory of operation. SysTick counts the cycles of a millisecond and its interrupt
// the milliseconds; USART1's interrupt moves bytes between the line and two rings.
// Nothing else happens in interrupts.
#pragma once

#include <array>
#include <cstdint>

#include "../hal/clock.hpp"
#include "../hal/pins.hpp"
#include "../hal/uart.hpp"

namespace bluepill {

constexpr std::uint32_t HCLK_HZ = 72'000'000;
constexpr std::uint32_t CYCLES_PER_MS = HCLK_HZ / 1'000;

//: Starts crystal, PLL, SysTick, pins and USART1.
void start();

//: Cycles of the core since `start`.
std::uint64_t cycles();

class Clock final : public hal::Clock {
 public:
  //: 72 cycles are 1000 ns.
  p2os::Nanos now() override { return static_cast<p2os::Nanos>(cycles() * 125 / 9); }
};

class Wires final : public hal::PinsIn, public hal::PinsOut {
 public:
  std::uint32_t read(p2os::Nanos) override;
  void drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos) override;
  void release(p2os::Nanos) override;
};

class Uart final : public hal::Uart {
 public:
  std::size_t read(std::uint8_t* data, std::size_t size) override;
  void write(p2os::Bytes data) override;
  void set_baud(std::int32_t baud) override;
};

//: Bytes that found a ring full; either is a fault.
extern volatile std::uint32_t lost_bytes;

}  // namespace bluepill
