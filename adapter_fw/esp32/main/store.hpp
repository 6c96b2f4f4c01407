// The settings in NVS, the ESP32's store of names and values in flash.
//
// NVS names have 15 characters at most, ours have more: each setting lies under the
// hash of its name. A setting that is renamed is a new one.
#pragma once

#include <nvs.h>

#include "../../core/app/console.hpp"

namespace esp32 {

class Store final : public app::Store {
 public:
  // Opens the store; one that is damaged, or of another layout, is begun anew.
  void start();

  bool load(const char* name, std::int64_t& value) override;
  bool save(const char* name, std::int64_t value) override;
  void forget(const char* name) override;

 private:
  nvs_handle_t handle_ = 0;
};

}  // namespace esp32
