#include "hardware.hpp"

#include "registers.hpp"

namespace bluepill {

volatile std::uint32_t lost_bytes = 0;

namespace {

//: Power of two. chosen: more than every frame that the core can have waiting (64 of 9 bytes).
constexpr std::uint32_t RING = 1'024;
constexpr std::uint32_t USART1_IRQ_BIT = 1U << (37 - 32);
constexpr std::uint32_t RXNE = 1U << 5, TXE = 1U << 7, RE = 1U << 2, TE = 1U << 3, RXNEIE = 1U << 5, TXEIE = 1U << 7,
                        UE = 1U << 13;
constexpr std::int32_t FIRST_BAUD = 9'600;
//: Outputs by their bit of the output word: the port, and the pin on it.
constexpr std::uint32_t DISTANCES = 8;
constexpr std::uint8_t ENCODER_PINS[] = {0, 1, 3, 4, 5, 6};
//: The input word's first bit on port B.
constexpr std::uint32_t INPUT_SHIFT = 8, INPUT_MASK = 0xFF;

//: Written at one end, read at the other, by an interrupt and the main program.
struct Ring {
  std::array<volatile std::uint8_t, RING> bytes;
  volatile std::uint32_t head;
  volatile std::uint32_t tail;

  bool is_empty() const { return head == tail; }
  void put(std::uint8_t byte) {
    if (head - tail == RING) {
      lost_bytes = lost_bytes + 1;
      return;
    }
    bytes[head % RING] = byte;
    head = head + 1;
  }
  std::uint8_t take() {
    const std::uint8_t byte = bytes[tail % RING];
    tail = tail + 1;
    return byte;
  }
};

Ring received, to_send;
volatile std::uint32_t milliseconds;

// Sets a port's pins of a mask to one nibble.
void set_mode(std::uint32_t port, std::uint32_t pins, std::uint32_t nibble) {
  for (std::uint32_t half = 0; half < 2; ++half) {
    std::uint32_t value = word(port + 4 * half);
    for (std::uint32_t pin = 0; pin < 8; ++pin) {
      if ((pins >> (8 * half + pin) & 1U) != 0) {
        value = (value & ~(0xFU << 4 * pin)) | nibble << 4 * pin;
      }
    }
    word(port + 4 * half) = value;
  }
}

//: Bits of the output word as pins of port B.
std::uint32_t on_port_b(std::uint32_t bits) {
  std::uint32_t pins = 0;
  for (std::uint32_t place = 0; place < sizeof ENCODER_PINS; ++place) {
    pins |= (bits >> (DISTANCES + place) & 1U) << ENCODER_PINS[place];
  }
  return pins;
}

// 8 MHz crystal x 9; two wait states above 48 MHz.
void start_clock() {
  word(RCC_CR) = word(RCC_CR) | 1U << 16;
  while ((word(RCC_CR) & 1U << 17) == 0) {
  }
  word(FLASH_ACR) = 1U << 4 | 2U;
  word(RCC_CFGR) = 1U << 16 | 7U << 18 | 4U << 8;
  word(RCC_CR) = word(RCC_CR) | 1U << 24;
  while ((word(RCC_CR) & 1U << 25) == 0) {
  }
  word(RCC_CFGR) = word(RCC_CFGR) | 2U;
  while ((word(RCC_CFGR) & 3U << 2) != 2U << 2) {
  }
}

}  // namespace

void start() {
  word(RCC_APB2ENR) = word(RCC_APB2ENR) | 1U << 0 | 1U << 2 | 1U << 3 | 1U << 14;
  [[maybe_unused]] const std::uint32_t is_on = word(RCC_APB2ENR);  // a clock needs two cycles to arrive
  word(AFIO_MAPR) = 2U << 24;  // PB3 and PB4 are JTAG's until it lets go
  start_clock();
  set_mode(GPIOA, 1U << 9, ALTERNATE_2MHZ);
  Uart().set_baud(FIRST_BAUD);
  word(USART_CR1) = UE | TE | RE | RXNEIE;
  word(NVIC_ISER1) = USART1_IRQ_BIT;
  word(SYSTICK_LOAD) = CYCLES_PER_MS - 1;
  word(SYSTICK_VAL) = 0;
  word(SYSTICK_CTRL) = 7;
}

// The interrupt that counts may come between the reads, or be about to come: then the counter has begun anew.
std::uint64_t cycles() {
  std::uint32_t before = 0;
  std::uint32_t left = 0;
  bool is_pending = false;
  do {
    before = milliseconds;
    left = word(SYSTICK_VAL);
    is_pending = (word(SCB_ICSR) & PENDSTSET) != 0;
    left = is_pending ? word(SYSTICK_VAL) : left;
  } while (before != milliseconds);
  const std::uint64_t whole = std::uint64_t{before} + (is_pending ? 1 : 0);
  return whole * CYCLES_PER_MS + (left == 0 ? 0 : CYCLES_PER_MS - left);
}

std::uint32_t Wires::read(p2os::Nanos) { return word(GPIOB + IDR) >> INPUT_SHIFT & INPUT_MASK; }

// The level first, then the driver: a wire never shows an old level.
void Wires::drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos) {
  const std::uint32_t a = mask & 0xFF, b = on_port_b(mask);
  word(GPIOA + BSRR) = (levels & a) | (~levels & a) << 16;
  word(GPIOB + BSRR) = on_port_b(levels & mask) | on_port_b(~levels & mask) << 16;
  set_mode(GPIOA, a, PUSH_PULL_2MHZ);
  set_mode(GPIOB, b, PUSH_PULL_2MHZ);
}

void Wires::release(p2os::Nanos) {
  set_mode(GPIOA, 0xFF, FLOATING);
  set_mode(GPIOB, on_port_b(~0U), FLOATING);
}

std::size_t Uart::read(std::uint8_t* data, std::size_t size) {
  std::size_t taken = 0;
  while (taken < size && !received.is_empty()) {
    data[taken++] = received.take();
  }
  return taken;
}

void Uart::write(p2os::Bytes data) {
  for (std::size_t place = 0; place < data.size; ++place) {
    to_send.put(data[place]);
  }
  interrupts_off();
  word(USART_CR1) = word(USART_CR1) | TXEIE;
  interrupts_on();
}

void Uart::set_baud(std::int32_t baud) {
  const auto speed = static_cast<std::uint32_t>(baud);
  word(USART_BRR) = (HCLK_HZ + speed / 2) / speed;
}

}  // namespace bluepill

extern "C" void SysTick_Handler() { bluepill::milliseconds = bluepill::milliseconds + 1; }

extern "C" void USART1_IRQHandler() {
  using namespace bluepill;
  const std::uint32_t status = word(USART_SR);
  if ((status & RXNE) != 0) {
    received.put(static_cast<std::uint8_t>(word(USART_DR)));
  }
  if ((status & TXE) != 0 && (word(USART_CR1) & TXEIE) != 0) {
    if (to_send.is_empty()) {
      word(USART_CR1) = word(USART_CR1) & ~TXEIE;
    } else {
      word(USART_DR) = to_send.take();
    }
  }
}
