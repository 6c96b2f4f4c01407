#include "standard.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

namespace host {

// O_NONBLOCK belongs to the open file, which a shell shares with us, not to the
// descriptor: terminals and pipes are opened once more. Where that cannot be, one byte
// is written whenever there is room for it. A file takes everything.
Standard::Standard(int descriptor) : descriptor_(descriptor) {
  struct stat what {};
  if (::fstat(descriptor, &what) != 0) {
    return;
  }
  if (S_ISSOCK(what.st_mode)) {
    kind_ = Kind::SOCKET;
  } else if (S_ISFIFO(what.st_mode) || ::isatty(descriptor) == 1) {
    const std::string path = "/proc/self/fd/" + std::to_string(descriptor);
    const int own = ::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    kind_ = own >= 0 ? Kind::OWN : Kind::SHARED;
    descriptor_ = own >= 0 ? own : descriptor;
  }
}

Standard::~Standard() {
  flush();
  if (kind_ == Kind::OWN) {
    ::close(descriptor_);
  }
}

void Standard::write(const char* text) {
  line_ += text;
  for (std::size_t end = line_.find('\n'); end != std::string::npos; end = line_.find('\n')) {
    if (left_out_ != 0 || waiting_.size() + end + 1 > MOST_WAITING) {
      ++left_out_;
    } else {
      waiting_.append(line_, 0, end + 1);
    }
    line_.erase(0, end + 1);
  }
  flush();
}

void Standard::flush() {
  while (!waiting_.empty()) {
    const long taken = take(waiting_.data(), waiting_.size());
    if (taken > 0) {
      waiting_.erase(0, static_cast<std::size_t>(taken));
      if (waiting_.empty() && left_out_ != 0) {
        waiting_ = "(" + std::to_string(left_out_) + " lines were left out)\n";
        left_out_ = 0;
      }
    } else if (taken < 0 && errno != EAGAIN && errno != EINTR) {
      waiting_.clear();  // nobody will ever read it
    } else {
      return;
    }
  }
}

long Standard::take(const char* data, std::size_t size) const {
  if (kind_ == Kind::SOCKET) {
    return ::send(descriptor_, data, size, MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  if (kind_ == Kind::SHARED) {
    pollfd room{descriptor_, POLLOUT, 0};
    if (::poll(&room, 1, 0) <= 0) {
      errno = EAGAIN;
      return -1;
    }
    size = 1;
  }
  return ::write(descriptor_, data, size);
}

}  // namespace host
