// Bluepad32 as the one source of pad reports: any pad that it knows, paired without an address in the code.
//
// Its callbacks run on its own task; the newest report crosses to the adapter's task
// through a queue of one, taken each millisecond. Every report counts, also one that equals the
// last: silence means that the pad is gone. A pad that only reports changes is lost
// to the adapter whenever its sticks are held still (setting pad_loss_ns).

#include <btstack_port_esp32.h>
#include <btstack_run_loop.h>
#include <freertos/FreeRTOS.h>
#include <freertos/queue.h>
#include <uni.h>

#include "pad.hpp"

namespace esp32 {

namespace {

class Queue final : public hal::Pad {
 public:
  void put(const adapter::PadReport& report) { xQueueOverwrite(queue_, &report); }
  bool take(adapter::PadReport& report) override { return xQueueReceive(queue_, &report, 0) == pdTRUE; }

 private:
  QueueHandle_t queue_ = xQueueCreate(1, sizeof(adapter::PadReport));
};

Queue& queue() {
  static Queue newest;
  return newest;
}

void take_data(uni_hid_device_t*, uni_controller_t* controller) {
  if (controller->klass != UNI_CONTROLLER_CLASS_GAMEPAD) {
    return;
  }
  const uni_gamepad_t& pad = controller->gamepad;
  queue().put({(pad.dpad & DPAD_UP) != 0, (pad.dpad & DPAD_DOWN) != 0, pad.throttle, pad.brake, pad.axis_rx});
}

uni_platform make_platform() {
  static char name[] = "p2os adapter";
  uni_platform platform = {};
  platform.name = name;
  platform.init = [](int, const char**) {};
  platform.on_init_complete = [] { uni_bt_start_scanning_and_autoconnect_unsafe(); };
  platform.on_device_connected = [](uni_hid_device_t*) {};
  platform.on_device_disconnected = [](uni_hid_device_t*) {};
  platform.on_device_ready = [](uni_hid_device_t*) { return UNI_ERROR_SUCCESS; };
  platform.on_controller_data = take_data;
  platform.get_property = [](uni_property_idx_t) -> const uni_property_t* { return nullptr; };
  platform.on_oob_event = [](uni_platform_oob_event_t, void*) {};
  return platform;
}

}  // namespace

hal::Pad* pad() { return &queue(); }

void run_pad() {
  static uni_platform platform = make_platform();
  btstack_init();
  uni_platform_set_custom(&platform);
  uni_init(0, nullptr);
  btstack_run_loop_execute();
}

}  // namespace esp32
