// The registers of an STM32F103 that this program uses, and no others.
//
// Source: RM0008 (RCC 7.3, FLASH PM0075, GPIO 9.2, AFIO 9.4, USART 27.6), PM0056 (SysTick 4.5, NVIC 4.3).
#pragma once

#include <cstdint>

namespace bluepill {

inline volatile std::uint32_t& word(std::uint32_t address) {
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}

constexpr std::uint32_t RCC_CR = 0x4002'1000, RCC_CFGR = 0x4002'1004, RCC_APB2ENR = 0x4002'1018;
constexpr std::uint32_t FLASH_ACR = 0x4002'2000, AFIO_MAPR = 0x4001'0004;
constexpr std::uint32_t GPIOA = 0x4001'0800, GPIOB = 0x4001'0C00;
//: Offsets within a port.
constexpr std::uint32_t CRL = 0x00, CRH = 0x04, IDR = 0x08, BSRR = 0x10;
constexpr std::uint32_t USART_SR = 0x4001'3800, USART_DR = 0x4001'3804, USART_BRR = 0x4001'3808,
                        USART_CR1 = 0x4001'380C;
constexpr std::uint32_t SYSTICK_CTRL = 0xE000'E010, SYSTICK_LOAD = 0xE000'E014, SYSTICK_VAL = 0xE000'E018;
constexpr std::uint32_t SCB_ICSR = 0xE000'ED04, PENDSTSET = 1U << 26;
constexpr std::uint32_t NVIC_ISER1 = 0xE000'E104;

//: One nibble of CRL or CRH a pin: CNF above MODE.
constexpr std::uint32_t FLOATING = 0x4, PUSH_PULL_2MHZ = 0x2, ALTERNATE_2MHZ = 0xA;

inline void interrupts_off() { asm volatile("cpsid i" ::: "memory"); }
inline void interrupts_on() { asm volatile("cpsie i\n\tisb" ::: "memory"); }
inline void wait_for_interrupt() { asm volatile("dsb\n\twfi" ::: "memory"); }

}  // namespace bluepill
