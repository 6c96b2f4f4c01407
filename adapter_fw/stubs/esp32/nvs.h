#pragma once
#include <esp_err.h>
typedef std::uint32_t nvs_handle_t;
typedef enum { NVS_READONLY, NVS_READWRITE } nvs_open_mode_t;
extern "C" {
esp_err_t nvs_open(const char* name, nvs_open_mode_t mode, nvs_handle_t* handle);
esp_err_t nvs_get_i64(nvs_handle_t handle, const char* key, std::int64_t* value);
esp_err_t nvs_set_i64(nvs_handle_t handle, const char* key, std::int64_t value);
esp_err_t nvs_erase_key(nvs_handle_t handle, const char* key);
esp_err_t nvs_commit(nvs_handle_t handle);
}
