// What the checks of single parts share: a claim that must hold, and a page that text is written to.
#pragma once

#include <cstdio>
#include <cstring>

#include "../../core/app/text.hpp"
#include "../../generated/rev_b/pins.hpp"
#include "../../generated/robots.hpp"

namespace units {

inline constexpr const adapter::RobotNumbers& ROBOT = *adapter::find_robot("p2dx");
inline constexpr const adapter::WireNumbers& WIRES = board::WIRES;

//: How many claims did not hold.
inline int broken = 0;

inline void claim(bool holds, const char* what) {
  if (!holds) {
    std::printf("broken: %s\n", what);
    ++broken;
  }
}

//: Text that was written, to be compared whole.
class Page final : public app::Writer {
 public:
  void write(const char* text) override { std::strncat(text_, text, sizeof text_ - std::strlen(text_) - 1); }
  //: Tells whether this was written and nothing else; the page is empty afterwards.
  bool is(const char* text) {
    const bool is_same = std::strcmp(text_, text) == 0;
    if (!is_same) {
      std::printf("found: %s\nwanted: %s\n", text_, text);
    }
    text_[0] = '\0';
    return is_same;
  }
  const char* text() const { return text_; }
  void clear() { text_[0] = '\0'; }

 private:
  char text_[4'096] = {};
};

void check_console();
void check_parts();

}  // namespace units
