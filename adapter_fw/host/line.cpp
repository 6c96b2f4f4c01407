#include "line.hpp"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace host {

namespace {

//: A write that cannot be finished for so long has nobody at its other end.
constexpr int WRITE_PATIENCE_MS = 200;

speed_t speed_of(std::int32_t baud) {
  switch (baud) {
    case 19'200:
      return B19200;
    case 38'400:
      return B38400;
    case 57'600:
      return B57600;
    case 115'200:
      return B115200;
    default:
      return B9600;
  }
}

}  // namespace

Line::~Line() {
  if (descriptor_ >= 0) {
    ::close(descriptor_);
  }
}

bool Line::open(const std::string& address, std::int32_t baud) {
  if (address.rfind("tcp:", 0) == 0) {
    const std::size_t colon = address.rfind(':');
    if (colon <= 4) {
      error_ = address + ": expected tcp:HOST:PORT";
      return false;
    }
    return open_tcp(address.substr(4, colon - 4), address.substr(colon + 1));
  }
  // As p2os names them; a baud of the address would be in the way of the search for the robot's.
  const std::size_t scheme = address.rfind("serial:", 0) == 0 ? 7 : address.rfind("pty:", 0) == 0 ? 4 : 0;
  descriptor_ = ::open(address.c_str() + scheme, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  if (descriptor_ < 0) {
    return fail(address);
  }
  is_terminal_ = ::isatty(descriptor_) == 1;
  set_baud(baud);
  return true;
}

bool Line::open_tcp(const std::string& host, const std::string& port) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int result = ::getaddrinfo(host.c_str(), port.c_str(), &hints, &found);
  if (result != 0) {
    error_ = host + ":" + port + ": " + ::gai_strerror(result);
    return false;
  }
  for (const addrinfo* address = found; address != nullptr && descriptor_ < 0; address = address->ai_next) {
    descriptor_ = ::socket(address->ai_family, address->ai_socktype | SOCK_CLOEXEC, address->ai_protocol);
    if (descriptor_ >= 0 && ::connect(descriptor_, address->ai_addr, address->ai_addrlen) != 0) {
      const int failure = errno;
      ::close(descriptor_);
      descriptor_ = -1;
      errno = failure;
    }
  }
  const int failure = errno;
  ::freeaddrinfo(found);
  if (descriptor_ < 0) {
    errno = failure;
    return fail(host + ":" + port);
  }
  const int on = 1;
  ::setsockopt(descriptor_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  ::fcntl(descriptor_, F_SETFL, ::fcntl(descriptor_, F_GETFL) | O_NONBLOCK);
  return true;
}

std::size_t Line::read(std::uint8_t* data, std::size_t size) {
  const ssize_t taken = ::read(descriptor_, data, size);
  if (taken > 0) {
    return static_cast<std::size_t>(taken);
  }
  // A pty whose other end is closed gives EIO; a socket gives 0.
  if (taken == 0 ? !is_terminal_ : errno != EAGAIN && errno != EINTR) {
    is_gone_ = true;
  }
  return 0;
}

void Line::write(p2os::Bytes data) {
  std::size_t place = 0;
  while (place < data.size && !is_gone_) {
    const ssize_t taken = ::write(descriptor_, data.data + place, data.size - place);
    if (taken > 0) {
      place += static_cast<std::size_t>(taken);
    } else if (taken < 0 && errno == EAGAIN) {
      pollfd ready{descriptor_, POLLOUT, 0};
      is_gone_ = ::poll(&ready, 1, WRITE_PATIENCE_MS) <= 0;
    } else if (taken < 0 && errno != EINTR) {
      is_gone_ = true;
    }
  }
}

void Line::set_baud(std::int32_t baud) {
  if (!is_terminal_) {
    return;
  }
  termios attributes{};
  if (::tcgetattr(descriptor_, &attributes) == 0) {
    ::cfmakeraw(&attributes);
    attributes.c_cflag |= CLOCAL | CREAD;
    ::cfsetspeed(&attributes, speed_of(baud));
    ::tcsetattr(descriptor_, TCSANOW, &attributes);
  }
}

bool Line::fail(const std::string& what) {
  error_ = what + ": " + std::strerror(errno);
  return false;
}

}  // namespace host
