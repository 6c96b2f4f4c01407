// Bluepad32 as far as the program uses it: pads are found, become ready or are declined, report, and go.

#include <btstack_port_esp32.h>
#include <btstack_run_loop.h>
#include <uni.h>

#include "machine.hpp"

namespace {

uni_platform* platform = nullptr;
uni_hid_device_t device{};
bool is_ready = false;

}  // namespace

extern "C" {

unsigned char btstack_init(void) { return 0; }
void uni_bt_start_scanning_and_autoconnect_unsafe(void) {}
void uni_platform_set_custom(struct uni_platform* made) { platform = made; }

int uni_init(int count, const char** words) {
  platform->init(count, words);
  platform->on_init_complete();
  return 0;
}

// On the ESP32 it never returns; here app_main ends, as it may.
void btstack_run_loop_execute(void) {}

int machine_pad_connect(std::int64_t address, int is_found) {
  if (platform == nullptr) {
    return 0;
  }
  for (int place = 5; place >= 0; --place, address >>= 8) {
    device.conn.btaddr[place] = static_cast<std::uint8_t>(address);
  }
  is_ready = is_found == 0 ||
             platform->on_device_discovered(device.conn.btaddr, "pad", 0x2508, 255) == UNI_ERROR_SUCCESS;
  if (is_ready) {
    platform->on_device_connected(&device);
    is_ready = platform->on_device_ready(&device) == UNI_ERROR_SUCCESS;
  }
  return is_ready ? 1 : 0;
}

void machine_pad_disconnect(void) {
  if (is_ready) {
    platform->on_device_disconnected(&device);
  }
  is_ready = false;
}

int machine_pad(int up, int down, std::int32_t throttle, std::int32_t brake, std::int32_t axis_rx) {
  if (!is_ready) {
    return 0;
  }
  uni_controller_t controller{};
  controller.klass = UNI_CONTROLLER_CLASS_GAMEPAD;
  controller.gamepad.dpad = static_cast<std::uint8_t>((up != 0 ? DPAD_UP : 0) | (down != 0 ? DPAD_DOWN : 0));
  controller.gamepad.throttle = throttle;
  controller.gamepad.brake = brake;
  controller.gamepad.axis_rx = axis_rx;
  platform->on_controller_data(&device, &controller);
  return 1;
}

}  // extern "C"
