#include "file_store.hpp"

#include <cstdio>
#include <fstream>
#include <utility>

namespace host {

FileStore::FileStore(std::string path) : path_(std::move(path)) {
  std::ifstream file(path_);
  std::string name;
  std::int64_t value = 0;
  while (file >> name >> value) {
    values_[name] = value;
  }
}

bool FileStore::load(const char* name, std::int64_t& value) {
  const auto found = values_.find(name);
  if (found == values_.end()) {
    return false;
  }
  value = found->second;
  return true;
}

bool FileStore::save(const char* name, std::int64_t value) {
  values_[name] = value;
  return write();
}

void FileStore::forget(const char* name) {
  values_.erase(name);
  write();
}

// Written beside and moved into its place: a cut leaves the old file or the new one.
bool FileStore::write() const {
  if (path_.empty()) {
    return true;
  }
  const std::string beside = path_ + ".new";
  {
    std::ofstream file(beside, std::ios::trunc);
    for (const auto& [name, value] : values_) {
      file << name << ' ' << value << '\n';
    }
    if (!file.flush()) {
      return false;
    }
  }
  return std::rename(beside.c_str(), path_.c_str()) == 0;
}

}  // namespace host
