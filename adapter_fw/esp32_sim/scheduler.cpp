// The clock, the one task and what ends it: FreeRTOS, esp_timer, esp_system, the task watchdog.

#include <esp_rom_sys.h>
#include <esp_system.h>
#include <esp_task_wdt.h>
#include <esp_timer.h>
#include <freertos/FreeRTOS.h>
#include <freertos/queue.h>
#include <freertos/task.h>
#include <ucontext.h>

#include <link.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "machine.hpp"

extern "C" void app_main();

namespace simulated {

machine_state state{};

namespace {

constexpr std::int64_t US_PER_TICK = 1'000;
constexpr std::int64_t NEVER_US = std::numeric_limits<std::int64_t>::max();
//: CONFIG_ESP_TASK_WDT_TIMEOUT_S of sdkconfig.defaults.
constexpr std::int64_t WATCHDOG_US = 1'000'000;
//: chosen: a desktop's frames are larger than the ESP32's; how much is used is reported.
constexpr std::size_t STACK_BYTES = 64 * 1'024;
constexpr std::uint8_t UNUSED = 0xA5;

struct Task {
  TaskFunction_t code = nullptr;
  void* parameters = nullptr;
  alignas(16) std::uint8_t stack[STACK_BYTES] = {};
  bool is_started = false;
  ucontext_t context{}, outside{};
  std::int64_t wakes_us = 0;
};
Task task;
std::int64_t fed_us = -1;

void begin() { task.code(task.parameters); }

[[noreturn]] void leave(machine_end end) {
  state.end = end;
  swapcontext(&task.context, &task.outside);
  __builtin_unreachable();
}

void start() {
  task.is_started = true;
  app_main();
  std::memset(task.stack, UNUSED, STACK_BYTES);
  getcontext(&task.context);
  task.context.uc_stack.ss_sp = task.stack;
  task.context.uc_stack.ss_size = STACK_BYTES;
  makecontext(&task.context, begin, 0);
}

}  // namespace

void wait_until(std::int64_t until_us) {
  task.wakes_us = until_us;
  swapcontext(&task.context, &task.outside);
}

}  // namespace simulated

using simulated::state;

void simulated_panic(const char* call) {
  state.panic = call;
  simulated::leave(MACHINE_PANICS);
}

extern "C" {

machine_state* machine(void) { return &state; }

int machine_run(std::int64_t until_us) {
  using namespace simulated;
  if (!task.is_started) {
    start();
  }
  take_captures();
  while (state.end == MACHINE_RUNS) {
    const std::int64_t hangs_us = fed_us < 0 ? NEVER_US : fed_us + WATCHDOG_US;
    const std::int64_t next_us = std::min({task.wakes_us, next_uart_us(), hangs_us});
    if (next_us > until_us) {
      state.now_us = std::max(state.now_us, until_us);
      break;
    }
    state.now_us = std::max(state.now_us, next_us);
    move_uarts(state.now_us);
    if (state.now_us >= hangs_us && task.wakes_us > state.now_us) {
      state.end = MACHINE_HANGS;
    } else if (task.wakes_us <= state.now_us) {
      swapcontext(&task.outside, &task.context);
    }
  }
  return state.end;
}

std::size_t machine_stack_used(void) {
  using namespace simulated;
  const std::uint8_t* first = task.stack;
  const std::uint8_t* end = first + STACK_BYTES;
  return static_cast<std::size_t>(end - std::find_if(first, end, [](std::uint8_t byte) { return byte != UNUSED; }));
}

// The writable segment of this library, without the head that the loader has closed to writing.
void machine_ram(std::uint8_t** start, std::size_t* size) {
  struct Found {
    std::uintptr_t inside, from, to;
  } found{reinterpret_cast<std::uintptr_t>(&state), 0, 0};
  dl_iterate_phdr(
      [](dl_phdr_info* library, std::size_t, void* result) {
        auto& place = *static_cast<Found*>(result);
        std::uintptr_t from = 0, to = 0, closed_to = 0;
        for (int number = 0; number < library->dlpi_phnum; ++number) {
          const auto& part = library->dlpi_phdr[number];
          const std::uintptr_t begin = library->dlpi_addr + part.p_vaddr, end = begin + part.p_memsz;
          if (part.p_type == PT_LOAD && begin <= place.inside && place.inside < end) {
            from = begin;
            to = end;
          } else if (part.p_type == PT_GNU_RELRO) {
            closed_to = end;
          }
        }
        if (to != 0) {
          place.from = std::max(from, closed_to);
          place.to = to;
        }
        return to != 0 ? 1 : 0;
      },
      &found);
  *start = reinterpret_cast<std::uint8_t*>(found.from);
  *size = found.to - found.from;
}

void machine_rtc(std::uint8_t** start, std::size_t* size) {
  extern std::uint8_t __start_rtc_noinit[], __stop_rtc_noinit[];
  *start = __start_rtc_noinit;
  *size = static_cast<std::size_t>(__stop_rtc_noinit - __start_rtc_noinit);
}

std::int64_t esp_timer_get_time(void) { return state.now_us; }

void esp_rom_delay_us(std::uint32_t us) { simulated::wait_until(state.now_us + us); }

void esp_restart(void) { simulated::leave(MACHINE_RESTARTS); }

esp_reset_reason_t esp_reset_reason(void) { return static_cast<esp_reset_reason_t>(state.reset_reason); }

esp_err_t esp_task_wdt_add(TaskHandle_t) {
  simulated::fed_us = state.now_us;
  return ESP_OK;
}

esp_err_t esp_task_wdt_reset(void) {
  simulated::fed_us = state.now_us;
  return ESP_OK;
}

BaseType_t xTaskCreatePinnedToCore(TaskFunction_t code, const char*, std::uint32_t stack_bytes, void* parameters,
                                   UBaseType_t, TaskHandle_t*, BaseType_t) {
  simulated::task.code = code;
  simulated::task.parameters = parameters;
  state.stack_bytes = stack_bytes;
  return pdTRUE;
}

TickType_t xTaskGetTickCount(void) { return static_cast<TickType_t>(state.now_us / simulated::US_PER_TICK); }

// As FreeRTOS: a task that is late does not sleep.
void vTaskDelayUntil(TickType_t* previous, TickType_t increment) {
  *previous += increment;
  const std::int64_t due_us = *previous * simulated::US_PER_TICK + state.stall_us;
  state.stall_us = 0;
  if (due_us > state.now_us) {
    simulated::wait_until(due_us);
  }
}

//: One, of one item: no program of ours has more.
struct QueueDefinition {
  std::uint8_t item[64];
  std::size_t size;
  bool is_full;
};
static QueueDefinition the_queue{};

QueueHandle_t xQueueCreate(UBaseType_t length, UBaseType_t item_size) {
  if (length != 1 || item_size > sizeof the_queue.item || the_queue.size != 0) {
    return nullptr;
  }
  the_queue.size = item_size;
  return &the_queue;
}

BaseType_t xQueueOverwrite(QueueHandle_t queue, const void* item) {
  std::memcpy(queue->item, item, queue->size);
  queue->is_full = true;
  return pdTRUE;
}

BaseType_t xQueueReceive(QueueHandle_t queue, void* item, TickType_t) {
  const bool was_full = queue->is_full;
  if (was_full) {
    std::memcpy(item, queue->item, queue->size);
    queue->is_full = false;
  }
  return was_full ? pdTRUE : 0;
}

}  // extern "C"
