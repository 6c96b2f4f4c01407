// An ESP32 as far as the adapter's program uses one, in virtual time: what a program outside sees of it.
//
// Not the chip's processor: the program is compiled for the machine that runs this, as a coroutine that gives way
// whenever it waits (vTaskDelayUntil, esp_rom_delay_us, a full UART), and runs in no time between. Source: the
// programming guide of ESP-IDF 5.4 (GPIO, UART, NVS, task watchdog, reset reasons).
//
// All variables of this library, the program's and the machine's, are one piece of memory (`machine_ram`): a reset puts
// it back to what it was when the library was loaded, and several machines take turns in it. So nothing here is on the
// heap. What outlives a reset is copied by whoever resets: NVS (`machine_nvs_*`), RTC memory (`machine_rtc`).
//
// Not modelled: the boot loader and its time, its words on UART0, the radio, the second core, interrupts but those of
// the capture unit and the UARTs, and the time that an interrupt takes.
#pragma once

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum machine_end {
  MACHINE_RUNS = 0,
  MACHINE_RESTARTS = 1,  // esp_restart
  MACHINE_PANICS = 2,    // ESP_ERROR_CHECK found an error: `panic` says which
  MACHINE_HANGS = 3      // the task watchdog was not reset for a second
};

enum machine_nvs_fault { NVS_SOUND = 0, NVS_OLD_LAYOUT = 1, NVS_FULL = 2, NVS_ERASED_BY_PROGRAM = 3 };

#define MACHINE_PORTS 3

//: Every field that is not said to be set from outside is only read there. Pins are bits of 64.
struct machine_state {
  int64_t now_us;            // since the reset
  uint64_t levels;           // set from outside: what stands on the pads
  uint64_t out;              // output register
  uint64_t driven;           // pads that the chip drives
  uint64_t inputs;           // pads whose input is on; others read 0
  uint64_t pulled_up, pulled_down;
  uint32_t changes;          // counts writes to what is driven or pulled
  int32_t end;               // machine_end
  const char* panic;
  int32_t reset_reason;      // set from outside before the start: esp_reset_reason_t
  int32_t nvs_fault;         // set from outside: machine_nvs_fault
  int64_t stall_us;          // set from outside: the task's next sleep is longer by this
  int32_t baud[MACHINE_PORTS], tx_pin[MACHINE_PORTS], rx_pin[MACHINE_PORTS];
  uint32_t lost[MACHINE_PORTS];  // bytes that found a receiver full, and those that it held
  uint32_t handed[MACHINE_PORTS];  // bytes that the driver has taken from a receiver
  uint32_t stack_bytes;      // what the program asked for
  int32_t shift_data, shift_clock, shift_latch;  // set from outside: pins of a 74HC595; latch 0: there is none
  uint32_t shifted;          // its outputs, QA is bit 0
};

struct machine_state* machine(void);

// Starts the program (the first time), and lets it run until it sleeps beyond `until_us`, or ends; returns `end`.
int machine_run(int64_t until_us);

// Returns the bytes of stack that the program has used so far, on this machine's processor.
size_t machine_stack_used(void);

// Bytes on the RX pin; `at_us` is when each one's stop bit ends, in order, none before now.
void machine_receive(int port, const uint8_t* data, const int64_t* at_us, size_t size);
// Takes bytes that have left at the TX pin by now; `at_us` is when each one's stop bit ended. Returns how many.
size_t machine_sent(int port, uint8_t* data, int64_t* at_us, size_t size);

// What is stored; an entry's place holds until the next write. machine_nvs_put is for before the start.
void machine_nvs_put(const char* space, const char* key, int64_t value);
size_t machine_nvs_count(void);
void machine_nvs_entry(size_t place, const char** space, const char** key, int64_t* value);

void machine_ram(uint8_t** start, size_t* size);
// The memory that every reset but one by EN or power leaves as it is.
void machine_rtc(uint8_t** start, size_t* size);

// A pad is found, or comes by itself, and wants to connect; false where the program has none, or declines this one.
int machine_pad_connect(int64_t address, int is_found);
void machine_pad_disconnect(void);
// A report of the pad that is connected; false where none is.
int machine_pad(int up, int down, int32_t throttle, int32_t brake, int32_t axis_rx);

#ifdef __cplusplus
}
#endif
