// A pointer to a neighbour that stays one's own when the rest is copied.
//
// Parts are saved and restored by copying them; whom they talk to is no part of
// what they know. So a copy starts without a neighbour, and an assignment keeps it.
#pragma once

namespace p2os {

template <typename Neighbour>
class Own {
 public:
  Own() = default;
  Own(const Own&) {}
  Own& operator=(const Own&) { return *this; }

  void set(Neighbour* neighbour) { neighbour_ = neighbour; }
  Neighbour* operator->() const { return neighbour_; }
  explicit operator bool() const { return neighbour_ != nullptr; }

 private:
  Neighbour* neighbour_ = nullptr;
};

}  // namespace p2os
