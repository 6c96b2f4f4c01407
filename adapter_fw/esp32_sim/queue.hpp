// A queue without heap; who fills it looks at its size first.
#pragma once

#include <cstddef>

namespace simulated {

template <typename Item, std::size_t MOST>
class Queue {
 public:
  std::size_t size() const { return count_; }
  bool empty() const { return count_ == 0; }
  bool is_full() const { return count_ == MOST; }
  const Item& front() const { return items_[first_]; }
  Item& front() { return items_[first_]; }
  void push_back(const Item& item) { items_[(first_ + count_++) % MOST] = item; }
  void pop_front() {
    first_ = (first_ + 1) % MOST;
    --count_;
  }
  void clear() { first_ = count_ = 0; }

 private:
  Item items_[MOST] = {};
  std::size_t first_ = 0, count_ = 0;
};

}  // namespace simulated
