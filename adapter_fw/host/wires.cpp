#include "wires.hpp"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace host {

namespace {

//: chosen: dozens of words; a far side that never ends must not keep the robot waiting.
constexpr int READS_A_TURN = 16;

}  // namespace

Wires::~Wires() {
  leave();
  if (listener_ >= 0) {
    ::close(listener_);
    ::unlink(path_.c_str());
  }
}

bool Wires::listen(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) {
    error_ = path + ": a socket's path has at most 107 characters";
    return false;
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  listener_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (listener_ < 0 || ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_, 1) != 0) {
    error_ = path + ": " + std::strerror(errno);
    return false;
  }
  path_ = path;
  return true;
}

void Wires::serve() {
  const int caller = listener_ < 0 ? -1 : ::accept4(listener_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (caller >= 0) {
    leave();
    far_side_ = caller;
    if (driven_ != 0) {
      drive(driven_, levels_, 0);
    }
  }
  char bytes[64];
  ssize_t taken = 1;
  for (int reads = 0; reads < READS_A_TURN && far_side_ >= 0 && taken > 0; ++reads) {
    taken = ::read(far_side_, bytes, sizeof bytes);
    for (ssize_t place = 0; place < taken; ++place) {
      take(bytes[place]);
    }
  }
  if (far_side_ >= 0 && (taken == 0 || (taken < 0 && errno != EAGAIN && errno != EINTR))) {
    leave();
  }
}

void Wires::drive(std::uint32_t mask, std::uint32_t levels, p2os::Nanos) {
  driven_ = mask == 0 ? 0 : driven_ | mask;
  levels_ = mask == 0 ? 0 : (levels_ & ~mask) | (levels & mask);
  if (far_side_ >= 0) {
    char line[32];
    const int size = std::snprintf(line, sizeof line, "out %x %x\n", static_cast<unsigned>(mask),
                                   static_cast<unsigned>(levels));
    // A far side that does not read loses edges, not the robot.
    (void)!::send(far_side_, line, static_cast<std::size_t>(size), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
}

void Wires::take(char character) {
  if (character != '\n') {
    if (size_ + 1 < line_.size()) {
      line_[size_++] = character;
    }
    return;
  }
  line_[size_] = '\0';
  size_ = 0;
  take_line();
}

// A line that is neither of the two is left out.
void Wires::take_line() {
  unsigned word = 0;
  int up = 0, down = 0, forward = 0, backward = 0, turn = 0, end = -1;
  if (std::sscanf(line_.data(), "in %x%n", &word, &end) == 1 && line_[static_cast<std::size_t>(end)] == '\0') {
    word_ = word;
  } else if (std::sscanf(line_.data(), "pad %d %d %d %d %d", &up, &down, &forward, &backward, &turn) == 5) {
    reports_.push_back({up != 0, down != 0, forward, backward, turn});
  }
}

bool Wires::take(adapter::PadReport& report) {
  if (reports_.empty()) {
    return false;
  }
  report = reports_.front();
  reports_.pop_front();
  return true;
}

void Wires::leave() {
  if (far_side_ >= 0) {
    ::close(far_side_);
    far_side_ = -1;
    size_ = 0;
    word_ &= ~connect_bit_;
  }
}

}  // namespace host
