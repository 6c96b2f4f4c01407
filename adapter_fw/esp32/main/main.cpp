// The ESP32's program: two tasks that only wire.
//
//     adapter   core 1, above all else of ours: one pass a millisecond, then the
//               console, the mode button and the LED. It alone touches the adapter.
//     main      core 0: the pad's radio, where there is one.
//
// The task watchdog resets the chip if the adapter's task hangs for a second: the
// outputs fall back to their pulls, and after the boot the first frame is STOP.

#include <esp_attr.h>
#include <esp_system.h>
#include <esp_task_wdt.h>
#include <freertos/FreeRTOS.h>
#include <freertos/task.h>

#include <pins.hpp>

#include "../../core/app/code_keeper.hpp"
#include "../../core/app/console.hpp"
#include "../../core/app/mode_button.hpp"
#include "../../core/app/runner.hpp"
#include "../../core/app/event_printer.hpp"
#include "../../generated/robots.hpp"
#include "clock.hpp"
#include "led.hpp"
#include "line.hpp"
#include "pad.hpp"
#include "store.hpp"
#include "terminal.hpp"
#include "wires.hpp"

namespace {

//: A name that p2os/robots does not have is no constant, and so does not compile.
constexpr const adapter::RobotNumbers& ROBOT = *adapter::find_robot(ADAPTER_ROBOT);

constexpr std::uint32_t STACK_BYTES = 12'288;
//: Above Bluepad32 and everything else that is not the system's own.
constexpr UBaseType_t PRIORITY = configMAX_PRIORITIES - 5;
constexpr BaseType_t CORE = 1;

//: Every restart but one by EN or power leaves it as it is.
RTC_NOINIT_ATTR app::RetainedWheels retained;

//: Why the chip began to run the program, as far as a person can do something about it.
const char* started_by() {
  switch (esp_reset_reason()) {
    case ESP_RST_POWERON:
      return "power or EN";
    case ESP_RST_SW:
      return "restart";
    case ESP_RST_PANIC:
      return "panic";
    case ESP_RST_TASK_WDT:
    case ESP_RST_INT_WDT:
    case ESP_RST_WDT:
      return "watchdog";
    case ESP_RST_BROWNOUT:
      return "brown-out";
    default:
      return "something else";
  }
}

adapter::Master other(adapter::Master master) {
  return master == adapter::Master::PAD ? adapter::Master::BLUEPILL : adapter::Master::PAD;
}

[[noreturn]] void run_adapter(void*) {
  const bool starts_with_pad = esp32::is_pad_jumper_fitted();
  static esp32::Clock clock;
  static esp32::Wires wires;
  static esp32::Line line;
  static esp32::Store store;
  static esp32::Terminal terminal;
  wires.start();
  terminal.start();
  store.start();
  esp32::start_mode_button();
  esp32::start_led();
  const char* fault = nullptr;
  const adapter::Settings settings = app::stored_settings(store, board::WIRES, fault);
  if (fault != nullptr) {
    terminal.write("stored settings are left out: ");
    terminal.write(fault);
    terminal.write("\n");
  }
  wires.measure_duties(settings);
  line.start(settings.bauds[0]);
  static app::EventLog log;
  static app::EventPrinter printer(log, terminal);
  static adapter::Adapter part(settings, ROBOT, board::WIRES, clock.now());
  static app::BoardTest test({wires, wires, wires, line, esp32::pad(store)});
  part.attach(&test, &test, &printer);
  app::CodeKeeper keeper(retained, store);
  keeper.restore(part);
  if (starts_with_pad) {
    part.set_master(adapter::Master::PAD, clock.now());
  }
  app::Runner runner(part, clock, test, test.pad());
  app::Console console({part, log, test, store, terminal, board::WIRES, board::REVISION, started_by()});
  app::ModeButton button;
  console.banner();
  ESP_ERROR_CHECK(esp_task_wdt_add(nullptr));
  TickType_t woken_at = xTaskGetTickCount();
  for (;;) {
    runner.pass();
    const p2os::Nanos now = clock.now();
    keeper.keep(part, now);
    for (char character = 0; terminal.take(character);) {
      console.take(character, now);
    }
    if (button.take(esp32::is_mode_button_down(), now)) {
      part.set_master(other(part.master()), now);
    }
    if (console.wants_restart()) {
      part.shutdown("restart", clock.now());
      runner.pass();
      terminal.send();
      line.drain();
      esp_restart();
    }
    terminal.send();
    esp32::show_on_led(part, now);
    esp_task_wdt_reset();
    vTaskDelayUntil(&woken_at, 1);
  }
}

}  // namespace

extern "C" void app_main() {
  xTaskCreatePinnedToCore(run_adapter, "adapter", STACK_BYTES, nullptr, PRIORITY, nullptr, CORE);
  esp32::run_pad();
}
