// The line to the robot on a PC: tcp:HOST:PORT, or a terminal such as /dev/ttyUSB0 or a pty.
#pragma once

#include <string>

#include "../hal/uart.hpp"

namespace host {

class Line final : public hal::Uart {
 public:
  Line() = default;
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;
  ~Line();

  // Opens an address; false where it cannot be, and `error()` is why.
  [[nodiscard]] bool open(const std::string& address, std::int32_t baud);

  std::size_t read(std::uint8_t* data, std::size_t size) override;
  void write(p2os::Bytes data) override;
  void set_baud(std::int32_t baud) override;

  int descriptor() const { return descriptor_; }
  // Tells whether the far side is gone.
  bool is_gone() const { return is_gone_; }
  const std::string& error() const { return error_; }

 private:
  bool open_tcp(const std::string& host, const std::string& port);
  bool fail(const std::string& what);

  int descriptor_ = -1;
  bool is_terminal_ = false;
  bool is_gone_ = false;
  std::string error_;
};

}  // namespace host
