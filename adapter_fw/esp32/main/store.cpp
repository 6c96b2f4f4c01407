#include "store.hpp"

#include <nvs_flash.h>

namespace esp32 {

namespace {

constexpr char NAMESPACE[] = "adapter";

//: "s" and eight hexadecimal digits of FNV-1a.
struct Key {
  char text[10] = {'s'};

  explicit Key(const char* name) {
    std::uint32_t hash = 2'166'136'261U;
    for (; *name != '\0'; ++name) {
      hash = (hash ^ static_cast<std::uint8_t>(*name)) * 16'777'619U;
    }
    for (int place = 8; place > 0; --place, hash >>= 4) {
      text[place] = "0123456789abcdef"[hash & 0xF];
    }
  }
};

}  // namespace

void Store::start() {
  const esp_err_t result = nvs_flash_init();
  if (result == ESP_ERR_NVS_NO_FREE_PAGES || result == ESP_ERR_NVS_NEW_VERSION_FOUND) {
    ESP_ERROR_CHECK(nvs_flash_erase());
    ESP_ERROR_CHECK(nvs_flash_init());
  }
  ESP_ERROR_CHECK(nvs_open(NAMESPACE, NVS_READWRITE, &handle_));
}

bool Store::load(const char* name, std::int64_t& value) {
  return nvs_get_i64(handle_, Key(name).text, &value) == ESP_OK;
}

bool Store::save(const char* name, std::int64_t value) {
  return nvs_set_i64(handle_, Key(name).text, value) == ESP_OK && nvs_commit(handle_) == ESP_OK;
}

void Store::forget(const char* name) {
  if (nvs_erase_key(handle_, Key(name).text) == ESP_OK) {
    nvs_commit(handle_);
  }
}

}  // namespace esp32
