// The self-test on an STM32F103 (the bench's own emulator runs it): results on USART1, PA9, 115200 8N1.
//
// SysTick runs free as a cycle counter, so that the longest call of the core is
// measured, too. Without wait states and interrupts: the chip's reset clock of 8 MHz.

#include <cstdint>

#include "../core/adapter/adapter.hpp"
#include "report.hpp"

namespace {

constexpr std::uint32_t HSI_HZ = 8'000'000;
constexpr std::uint32_t BAUD = 115'200;
constexpr std::uint32_t SYSTICK_MASK = 0xFF'FFFF;
//: Virtual seconds of the run; the result is compared with the host's.
constexpr p2os::Nanos SPAN_NS = 20 * p2os::NS_PER_S;

volatile std::uint32_t& word(std::uint32_t address) { return *reinterpret_cast<volatile std::uint32_t*>(address); }

constexpr std::uint32_t RCC_APB2ENR = 0x4002'1018, GPIOA_CRH = 0x4001'0804, USART1 = 0x4001'3800;
constexpr std::uint32_t USART_SR = USART1, USART_DR = USART1 + 4, USART_BRR = USART1 + 8, USART_CR1 = USART1 + 12;
constexpr std::uint32_t SYSTICK_CTRL = 0xE000'E010, SYSTICK_LOAD = 0xE000'E014, SYSTICK_VAL = 0xE000'E018;

std::uint32_t started;
std::uint32_t longest;

void write(const char* text) {
  for (; *text != '\0'; ++text) {
    while ((word(USART_SR) & 1U << 7) == 0) {
    }
    word(USART_DR) = static_cast<std::uint8_t>(*text);
  }
}

}  // namespace

extern "C" int main() {
  word(RCC_APB2ENR) = 1U << 14 | 1U << 2;
  word(GPIOA_CRH) = (word(GPIOA_CRH) & ~0xF0U) | 0xB0U;
  word(USART_BRR) = (HSI_HZ + BAUD / 2) / BAUD;
  word(USART_CR1) = 1U << 13 | 1U << 3;
  word(SYSTICK_LOAD) = SYSTICK_MASK;
  word(SYSTICK_VAL) = 0;
  word(SYSTICK_CTRL) = 5;
  selftest::before_step = [] { started = word(SYSTICK_VAL); };
  selftest::after_step = [] {
    const std::uint32_t taken = (started - word(SYSTICK_VAL)) & SYSTICK_MASK;
    longest = taken > longest ? taken : longest;
  };
  const selftest::Result result = selftest::run(SPAN_NS, 1);
  write("longest_call_cycles ");
  selftest::write_number(write, longest);
  write("\nadapter_bytes ");
  selftest::write_number(write, sizeof(adapter::Adapter));
  write("\n");
  selftest::report(result, write);
  for (;;) {
    asm volatile("wfi");
  }
}
