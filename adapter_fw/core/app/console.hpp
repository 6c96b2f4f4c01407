// The adapter's console: lines in, text out. The same on a PC and behind the ESP32's USB port.
//
//   help                 what there is
//   version              firmware and board; no build time, for builds are repeatable
//   status               state, master, speeds, counts, counters of the line
//   pins                 every wire's level
//   log                  the last events
//   get [NAME]           one setting, or all
//   set NAME VALUE       stored at once, in force after `restart`
//   reset NAME           back to the default
//   master bluepill|pad  gives the robot to the other one
//   stop                 stops the robot until its master asks anew
//   restart              stops the robot, then begins anew with the stored settings
//   test on|off          stops the robot and takes the hardware from the adapter; gives it back
//   wires [MASK LEVELS]  every pad in hexadecimal, after these outputs alone were driven (in a test)
//   link [HEX]           what came on the line; or sends up to 16 bytes (in a test)
//   pad                  the last report of the game pad, and how many came
//   pad pair             obeys the pad that connects within 30 s, and no other from then on
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "../adapter/adapter.hpp"
#include "board_test.hpp"
#include "event_log.hpp"
#include "text.hpp"

namespace app {

//: Where settings stay while the power is off.
class Store {
 public:
  //: Returns false where nothing is stored under the name.
  virtual bool load(const char* name, std::int64_t& value) = 0;
  //: Returns false where it could not be stored.
  virtual bool save(const char* name, std::int64_t value) = 0;
  virtual void forget(const char* name) = 0;

 protected:
  ~Store() = default;
};

// Returns the defaults with what is stored in their place; if these have a fault, the defaults, and `fault` is why.
adapter::Settings stored_settings(Store& store, const adapter::WireNumbers& wires, const char*& fault);

class Console {
 public:
  struct Parts {
    adapter::Adapter& adapter;
    const EventLog& log;
    BoardTest& test;
    Store& store;
    Writer& writer;
    const adapter::WireNumbers& wires;
    //: Such as "rev-b" or "host".
    const char* board;
    //: Why the program runs, such as "power" or "watchdog".
    const char* started_by;
  };

  explicit Console(const Parts& parts) : parts_(parts) {}

  // Takes characters as they come; a line is done at its end.
  void take(char character, p2os::Nanos now);

  // Writes firmware and board; for the start.
  void banner();

  // Tells whether `restart` was asked for; the program has to make a new adapter.
  bool wants_restart() const { return wants_restart_; }

 private:
  void run(char* line, p2os::Nanos now);
  void status();
  void pins(p2os::Nanos now);
  void test(bool is_on, p2os::Nanos now);
  void wires(const char* mask, const char* levels, p2os::Nanos now);
  void link(const char* hex);
  void pad();
  void pair(p2os::Nanos now);
  bool is_in_test();
  void get(const char* name);
  void set(const char* name, const char* value);
  void reset(const char* name);
  void number(const char* name, std::int64_t value);
  void show(std::int32_t place, const adapter::Settings& settings);

  Parts parts_;
  std::array<char, 80> line_{};
  std::size_t size_ = 0;
  bool is_too_long_ = false;
  bool wants_restart_ = false;
};

}  // namespace app
