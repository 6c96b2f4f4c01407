// Non-volatile storage: values of 64 bits by namespace and name, 15 characters at most each; kept when committed.

#include <nvs_flash.h>

#include <cstring>

#include "machine.hpp"

using simulated::state;

namespace {

constexpr esp_err_t NVS_NOT_FOUND = 0x1102, NVS_NO_ROOM = 0x1105, NVS_NAME_TOO_LONG = 0x1109, NVS_NOT_INIT = 0x1101;
constexpr std::size_t NAME_CHARACTERS = 15;
//: chosen: twice what the program has names for; a partition of 24 KB holds hundreds.
constexpr std::size_t MOST = 128, SPACES = 4;

struct Name {
  char text[NAME_CHARACTERS + 1];
};

struct Entry {
  Name space, key;
  std::int64_t value;
};

class Entries {
 public:
  std::size_t size() const { return count_; }
  const Entry& operator[](std::size_t place) const { return entries_[place]; }
  void clear() { count_ = 0; }

  Entry* find(const char* space, const char* key) {
    for (std::size_t place = 0; place < count_; ++place) {
      Entry& entry = entries_[place];
      if (std::strcmp(entry.space.text, space) == 0 && std::strcmp(entry.key.text, key) == 0) {
        return &entry;
      }
    }
    return nullptr;
  }

  bool put(const char* space, const char* key, std::int64_t value) {
    Entry* entry = find(space, key);
    if (entry == nullptr) {
      if (count_ == MOST) {
        return false;
      }
      entry = &entries_[count_++];
      std::strncpy(entry->space.text, space, NAME_CHARACTERS);
      std::strncpy(entry->key.text, key, NAME_CHARACTERS);
    }
    entry->value = value;
    return true;
  }

  bool erase(const char* space, const char* key) {
    Entry* entry = find(space, key);
    if (entry != nullptr) {
      *entry = entries_[--count_];
      entries_[count_] = {};
    }
    return entry != nullptr;
  }

 private:
  Entry entries_[MOST] = {};
  std::size_t count_ = 0;
};
Entries stored, open_entries;
Name spaces[SPACES];
std::size_t space_count = 0;
bool is_initialised = false;

const char* space_of(nvs_handle_t handle) { return spaces[handle - 1].text; }

}  // namespace

extern "C" {

void machine_nvs_put(const char* space, const char* key, std::int64_t value) { stored.put(space, key, value); }

std::size_t machine_nvs_count(void) { return stored.size(); }

void machine_nvs_entry(std::size_t place, const char** space, const char** key, std::int64_t* value) {
  *space = stored[place].space.text;
  *key = stored[place].key.text;
  *value = stored[place].value;
}

esp_err_t nvs_flash_init(void) {
  if (state.nvs_fault == NVS_OLD_LAYOUT) {
    return ESP_ERR_NVS_NEW_VERSION_FOUND;
  }
  is_initialised = true;
  open_entries = stored;
  return ESP_OK;
}

esp_err_t nvs_flash_erase(void) {
  stored.clear();
  state.nvs_fault = NVS_ERASED_BY_PROGRAM;
  return ESP_OK;
}

esp_err_t nvs_open(const char* name, nvs_open_mode_t, nvs_handle_t* handle) {
  if (!is_initialised) {
    return NVS_NOT_INIT;
  }
  if (std::strlen(name) > NAME_CHARACTERS || space_count == SPACES) {
    return NVS_NAME_TOO_LONG;
  }
  std::strcpy(spaces[space_count++].text, name);
  *handle = static_cast<nvs_handle_t>(space_count);
  return ESP_OK;
}

esp_err_t nvs_get_i64(nvs_handle_t handle, const char* key, std::int64_t* value) {
  const Entry* found = open_entries.find(space_of(handle), key);
  if (found == nullptr) {
    return NVS_NOT_FOUND;
  }
  *value = found->value;
  return ESP_OK;
}

esp_err_t nvs_set_i64(nvs_handle_t handle, const char* key, std::int64_t value) {
  if (std::strlen(key) > NAME_CHARACTERS) {
    return NVS_NAME_TOO_LONG;
  }
  return state.nvs_fault != NVS_FULL && open_entries.put(space_of(handle), key, value) ? ESP_OK : NVS_NO_ROOM;
}

esp_err_t nvs_erase_key(nvs_handle_t handle, const char* key) {
  return open_entries.erase(space_of(handle), key) ? ESP_OK : NVS_NOT_FOUND;
}

esp_err_t nvs_commit(nvs_handle_t) {
  stored = open_entries;
  return ESP_OK;
}

}  // extern "C"
