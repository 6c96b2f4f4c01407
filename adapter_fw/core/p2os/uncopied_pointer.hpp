// A pointer that a copy of its owner does not take over.
//
// Parts are saved and restored by copying them; the objects they are connected to are
// no part of their state. So a copy starts unconnected, and an assignment keeps the
// connection of its target.
#pragma once

namespace p2os {

template <typename Target>
class UncopiedPointer {
 public:
  UncopiedPointer() = default;
  UncopiedPointer(const UncopiedPointer&) {}
  UncopiedPointer& operator=(const UncopiedPointer&) { return *this; }

  void set(Target* target) { target_ = target; }
  Target* operator->() const { return target_; }
  explicit operator bool() const { return target_ != nullptr; }

 private:
  Target* target_ = nullptr;
};

}  // namespace p2os
