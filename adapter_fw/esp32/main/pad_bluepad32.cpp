// Bluepad32 as the one source of pad reports: any pad that it knows, paired without an address in the code.
//
// One pad is obeyed: the one that a person has paired (`pad pair`), whose address is kept in flash. Every other is
// declined when it is found and again when it is ready, which has Bluepad32 disconnect it; what it may report is left out.
//
// Its callbacks run on its own task; the newest report crosses to the adapter's task
// through a queue of one, taken each millisecond. Every report counts, also one that equals the
// last: silence means that the pad is gone. A pad that only reports changes is lost
// to the adapter whenever its sticks are held still (setting pad_loss_ns).

#include <btstack_port_esp32.h>
#include <btstack_run_loop.h>
#include <esp_timer.h>
#include <freertos/FreeRTOS.h>
#include <freertos/queue.h>
#include <uni.h>

#include <atomic>

#include "pad.hpp"

namespace esp32 {

namespace {

class Queue final : public hal::Pad {
 public:
  void put(const adapter::PadReport& report) { xQueueOverwrite(queue_, &report); }
  bool take(adapter::PadReport& report) override { return xQueueReceive(queue_, &report, 0) == pdTRUE; }
  void pair(p2os::Nanos now) override;

 private:
  QueueHandle_t queue_ = xQueueCreate(1, sizeof(adapter::PadReport));
};

Queue& queue() {
  static Queue newest;
  return newest;
}

constexpr char ADDRESS[] = "pad_address";
constexpr std::int64_t NO_ADDRESS = -1, US_PER_S = 1'000'000;

//: Set by the adapter's task, read by the radio's; seconds since the start, 0: no pairing is under way.
std::atomic<std::uint32_t> pairing_ends_s{0};
std::atomic<Store*> settings{nullptr};
//: Of the pad that is obeyed; the radio's task alone.
std::int64_t paired = NO_ADDRESS;

std::int64_t number_of(const bd_addr_t address) {
  std::int64_t number = 0;
  for (int place = 0; place < 6; ++place) {
    number = number << 8 | address[place];
  }
  return number;
}

bool is_pairing() { return esp_timer_get_time() < pairing_ends_s * US_PER_S; }

bool is_paired(std::int64_t address) {
  Store* store = settings;
  if (paired == NO_ADDRESS && (store == nullptr || !store->load(ADDRESS, paired))) {
    paired = NO_ADDRESS;
  }
  return paired == address;
}

// Tells whether a pad that is ready is obeyed; while a pairing is under way it becomes the one that is.
bool admits(std::int64_t address) {
  if (is_paired(address)) {
    return true;
  }
  Store* store = settings;
  if (!is_pairing() || store == nullptr || !store->save(ADDRESS, address)) {
    return false;
  }
  paired = address;
  pairing_ends_s = 0;
  return true;
}

uni_error_t answer(bool is_wanted) { return is_wanted ? UNI_ERROR_SUCCESS : UNI_ERROR_IGNORE_DEVICE; }

void take_data(uni_hid_device_t* device, uni_controller_t* controller) {
  if (controller->klass != UNI_CONTROLLER_CLASS_GAMEPAD || !is_paired(number_of(device->conn.btaddr))) {
    return;
  }
  const uni_gamepad_t& pad = controller->gamepad;
  queue().put({(pad.dpad & DPAD_UP) != 0, (pad.dpad & DPAD_DOWN) != 0, pad.throttle, pad.brake, pad.axis_rx});
}

void Queue::pair(p2os::Nanos now) {
  pairing_ends_s = static_cast<std::uint32_t>((now + PAIRING_NS) / p2os::NS_PER_S);
}

uni_platform make_platform() {
  static char name[] = "p2os adapter";
  uni_platform platform = {};
  platform.name = name;
  platform.init = [](int, const char**) {};
  platform.on_init_complete = [] { uni_bt_start_scanning_and_autoconnect_unsafe(); };
  platform.on_device_discovered = [](bd_addr_t address, const char*, std::uint16_t, std::uint8_t) {
    return answer(is_pairing() || is_paired(number_of(address)));
  };
  platform.on_device_connected = [](uni_hid_device_t*) {};
  platform.on_device_disconnected = [](uni_hid_device_t*) {};
  platform.on_device_ready = [](uni_hid_device_t* device) { return answer(admits(number_of(device->conn.btaddr))); };
  platform.on_controller_data = take_data;
  platform.get_property = [](uni_property_idx_t) -> const uni_property_t* { return nullptr; };
  platform.on_oob_event = [](uni_platform_oob_event_t, void*) {};
  return platform;
}

}  // namespace

hal::Pad* pad(Store& store) {
  settings = &store;
  return &queue();
}

void run_pad() {
  static uni_platform platform = make_platform();
  btstack_init();
  uni_platform_set_custom(&platform);
  uni_init(0, nullptr);
  btstack_run_loop_execute();
}

}  // namespace esp32
