// The adapter as a PC program: the firmware's core on any line, its wires on a Unix socket.
//
//   p2os-adapter --line tcp:127.0.0.1:8101 [--wires /tmp/wires.sock] [--robot p2dx] [--settings FILE]
//
// Standard input is the console (type help), events go to standard error with the
// milliseconds since the start; nobody has to read them. Every signal that would end or
// stop the program stops and closes the robot first, but SIGKILL and SIGSTOP, which none
// can catch, and those of a crash. After a pause (suspend, SIGSTOP) STOP goes out first.
// Exit codes: 1 the line is gone or cannot be opened, 2 wrong usage, 130 interrupted.

#include <poll.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <string>

#include "../core/app/code_keeper.hpp"
#include "../core/app/console.hpp"
#include "../core/app/runner.hpp"
#include "../core/app/event_printer.hpp"
#include "../generated/rev_b/pins.hpp"
#include "../generated/robots.hpp"
#include "file_store.hpp"
#include "line.hpp"
#include "standard.hpp"
#include "wires.hpp"

namespace {

constexpr int RESTART = -1, INTERRUPTED = 130;
//: chosen: some lines; a file without end on standard input must not keep the robot waiting.
constexpr int TYPED_A_TURN = 256;

volatile std::sig_atomic_t interrupted = 0;

#ifdef CLOCK_BOOTTIME
//: It counts the time in which the machine sleeps; Linux' CLOCK_MONOTONIC does not.
constexpr clockid_t CLOCK = CLOCK_BOOTTIME;
#else
constexpr clockid_t CLOCK = CLOCK_MONOTONIC;
#endif

//: Ctrl-C, Ctrl-Z, a quit, a closed terminal, kill, and what ends a program unless it is caught.
constexpr int ENDING[] = {SIGINT,  SIGTERM, SIGHUP,    SIGQUIT, SIGTSTP, SIGUSR1,
                          SIGUSR2, SIGALRM, SIGVTALRM, SIGPROF, SIGXCPU};
//: A far side that has gone, a full disk, and the terminal of another program: each call returns its own error.
constexpr int IGNORED[] = {SIGPIPE, SIGXFSZ, SIGTTIN, SIGTTOU};

class WallClock final : public hal::Clock {
 public:
  p2os::Nanos now() override { return read() - start_; }

 private:
  static p2os::Nanos read() {
    timespec time{};
    ::clock_gettime(CLOCK, &time);
    return time.tv_sec * p2os::NS_PER_S + time.tv_nsec;
  }

  p2os::Nanos start_ = read();
};

struct Options {
  std::string line;
  std::string wires;
  std::string robot = "p2dx";
  std::string settings;
};

int refuse(const std::string& what, const char* hint) {
  std::fprintf(stderr, "p2os-adapter: %s\nhint: %s\n", what.c_str(), hint);
  return 2;
}

bool read_options(int count, char** words, Options& options) {
  const struct {
    const char* name;
    std::string* value;
  } known[] = {{"--line", &options.line}, {"--wires", &options.wires}, {"--robot", &options.robot},
               {"--settings", &options.settings}};
  for (int place = 1; place < count; place += 2) {
    std::string* value = nullptr;
    for (const auto& option : known) {
      value = std::strcmp(words[place], option.name) == 0 ? option.value : value;
    }
    if (value == nullptr || place + 1 == count) {
      return false;
    }
    *value = words[place + 1];
  }
  return !options.line.empty();
}

//: A program that was started with SIGHUP ignored (nohup) keeps it ignored.
void catch_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { interrupted = 1; };
  for (const int number : ENDING) {
    struct sigaction before {};
    ::sigaction(number, nullptr, &before);
    if (number != SIGHUP || before.sa_handler != SIG_IGN) {
      ::sigaction(number, &action, nullptr);
    }
  }
  for (const int number : IGNORED) {
    std::signal(number, SIG_IGN);
  }
}

//: Sleeps until something has come or `span` is over; a negative descriptor is left out.
void wait(const host::Line& line, const host::Wires& wires, int input, p2os::Nanos span) {
  pollfd files[] = {{line.descriptor(), POLLIN, 0},
                    {input, POLLIN, 0},
                    {wires.listening(), POLLIN, 0},
                    {wires.connected(), POLLIN, 0}};
  const p2os::Nanos bounded = span < 0 ? 0 : p2os::earlier(span, 100 * p2os::NS_PER_MS);
  timespec timeout{0, static_cast<long>(bounded)};
  ::ppoll(files, sizeof files / sizeof files[0], &timeout, nullptr);
}

//: Returns the exit code, or RESTART.
int run(const Options& options, host::Line& line, host::Wires& wires, host::FileStore& store, host::Standard& out,
        host::Standard& err, WallClock& clock, app::RetainedWheels& retained) {
  const adapter::WireNumbers& numbers = board::WIRES;
  const char* fault = nullptr;
  const adapter::Settings settings = app::stored_settings(store, numbers, fault);
  if (fault != nullptr) {
    err.write("stored settings are left out: ");
    err.write(fault);
    err.write("\n");
  }
  app::EventLog log;
  app::EventPrinter printer(log, err);
  adapter::Adapter part(settings, *adapter::find_robot(options.robot.c_str()), numbers, clock.now());
  app::BoardTest test({wires, wires, wires, line, &wires});
  part.attach(&test, &test, &printer);
  app::CodeKeeper keeper(retained, store);
  keeper.restore(part);
  app::Console console({part, log, test, store, out, numbers, "host", "the program's start"});
  app::Runner runner(part, clock, test, test.pad());
  wires.release(clock.now());
  console.banner();
  int input = STDIN_FILENO;
  while (true) {
    wires.serve();
    const p2os::Nanos due = runner.pass();
    keeper.keep(part, clock.now());
    char character = 0;
    pollfd file{input, POLLIN, 0};
    for (int taken = 0; taken < TYPED_A_TURN && ::poll(&file, 1, 0) > 0; ++taken, file.fd = input) {
      if (::read(input, &character, 1) == 1) {
        console.take(character, clock.now());
      } else {
        input = -1;  // a console that has ended leaves the adapter running
      }
    }
    out.flush();
    err.flush();
    if (interrupted != 0 || console.wants_restart() || line.is_gone()) {
      part.shutdown("the program ends", clock.now());
      runner.pass();
      return line.is_gone() ? 1 : interrupted != 0 ? INTERRUPTED : RESTART;
    }
    wait(line, wires, input, due - clock.now());
  }
}

}  // namespace

int main(int count, char** words) {
  Options options;
  if (!read_options(count, words, options)) {
    return refuse("wrong usage",
                  "p2os-adapter --line tcp:HOST:PORT|/dev/ttyUSB0 [--wires SOCKET] [--robot p2dx] [--settings FILE]");
  }
  if (adapter::find_robot(options.robot.c_str()) == nullptr) {
    return refuse("there is no robot " + options.robot, "a subclass such as p2dx or p3at");
  }
  catch_signals();
  host::FileStore store(options.settings);
  host::Wires wires(board::WIRES);
  if (!options.wires.empty() && !wires.listen(options.wires)) {
    return refuse(wires.error(), "a path that does not exist yet");
  }
  host::Line line;
  if (!line.open(options.line, adapter::Settings{}.bauds[0])) {
    std::fprintf(stderr, "p2os-adapter: cannot open %s\nhint: p2os ports\n", line.error().c_str());
    return 1;
  }
  host::Standard out(STDOUT_FILENO), err(STDERR_FILENO);
  WallClock clock;
  app::RetainedWheels retained{};
  int ended = RESTART;
  while (ended == RESTART) {
    ended = run(options, line, wires, store, out, err, clock, retained);
  }
  if (line.is_gone()) {
    const std::string what = "p2os-adapter: the line " + options.line + " is gone\n";
    err.write((what + "hint: is the robot on, and its cable in?\n").c_str());
  }
  return ended;
}
