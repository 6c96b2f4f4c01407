// The settings in a file of lines `name value`; without a file, in memory only.
#pragma once

#include <map>
#include <string>

#include "../core/app/console.hpp"

namespace host {

class FileStore final : public app::Store {
 public:
  explicit FileStore(std::string path);

  bool load(const char* name, std::int64_t& value) override;
  bool save(const char* name, std::int64_t value) override;
  void forget(const char* name) override;

 private:
  bool write() const;

  std::string path_;
  std::map<std::string, std::int64_t> values_;
};

}  // namespace host
