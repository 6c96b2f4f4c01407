// Bluepad32 4.2.
#pragma once
#include <cstdint>
typedef std::uint8_t bd_addr_t[6];
typedef struct uni_hid_device_s {
  struct {
    bd_addr_t btaddr;
  } conn;
} uni_hid_device_t;
typedef struct uni_property_s uni_property_t;
typedef enum { UNI_PROPERTY_IDX_COUNT } uni_property_idx_t;
typedef enum { UNI_ERROR_SUCCESS = 0, UNI_ERROR_IGNORE_DEVICE = 5 } uni_error_t;
typedef enum { UNI_PLATFORM_OOB_GAMEPAD_SYSTEM_BUTTON } uni_platform_oob_event_t;
typedef enum { UNI_CONTROLLER_CLASS_NONE, UNI_CONTROLLER_CLASS_GAMEPAD } uni_controller_class_t;
enum { DPAD_UP = 1 << 0, DPAD_DOWN = 1 << 1 };
typedef struct {
  std::uint8_t dpad;
  std::int32_t axis_x, axis_y, axis_rx, axis_ry;
  std::int32_t brake, throttle;
} uni_gamepad_t;
typedef struct {
  uni_controller_class_t klass;
  union {
    uni_gamepad_t gamepad;
  };
} uni_controller_t;
struct uni_platform {
  char* name;
  void (*init)(int count, const char** words);
  void (*on_init_complete)(void);
  uni_error_t (*on_device_discovered)(bd_addr_t address, const char* name, std::uint16_t kind, std::uint8_t strength);
  void (*on_device_connected)(uni_hid_device_t* device);
  void (*on_device_disconnected)(uni_hid_device_t* device);
  uni_error_t (*on_device_ready)(uni_hid_device_t* device);
  void (*on_controller_data)(uni_hid_device_t* device, uni_controller_t* controller);
  const uni_property_t* (*get_property)(uni_property_idx_t place);
  void (*on_oob_event)(uni_platform_oob_event_t event, void* data);
};
extern "C" {
void uni_bt_start_scanning_and_autoconnect_unsafe(void);
void uni_platform_set_custom(struct uni_platform* platform);
int uni_init(int count, const char** words);
}
