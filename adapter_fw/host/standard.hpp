// Standard output and standard error of a program that must not wait for whoever reads them.
//
// A terminal that is held with Ctrl-S and a pipe that is full take nothing: what they
// have not taken waits, up to MOST_WAITING bytes. From there on whole lines are left out
// until all that waits has been taken; then their number is written.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "../core/app/text.hpp"

namespace host {

class Standard final : public app::Writer {
 public:
  //: chosen: more than the console's longest answer, and more than a minute of events.
  static constexpr std::size_t MOST_WAITING = 16'384;

  explicit Standard(int descriptor);
  Standard(const Standard&) = delete;
  Standard& operator=(const Standard&) = delete;
  ~Standard();

  void write(const char* text) override;
  // Hands on what is waiting, as far as it is taken at once.
  void flush();

 private:
  enum class Kind : std::uint8_t { FILE, SOCKET, OWN, SHARED };

  // Writes once without waiting; returns what `write` does.
  long take(const char* data, std::size_t size) const;

  int descriptor_;
  Kind kind_ = Kind::FILE;
  std::string line_;
  std::string waiting_;
  unsigned left_out_ = 0;
};

}  // namespace host
