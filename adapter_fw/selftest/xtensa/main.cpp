// The self-test on a bare Xtensa: QEMU's `sim` machine (start.S, sim.ld), or an ESP32's memory (esp32.S, esp32.ld).

#include "../../core/adapter/adapter.hpp"
#include "../report.hpp"

extern "C" void write_text(const char* text, unsigned size);

namespace {

constexpr p2os::Nanos SPAN_NS = 20 * p2os::NS_PER_S;

void write(const char* text) {
  unsigned size = 0;
  while (text[size] != '\0') {
    ++size;
  }
  write_text(text, size);
}

}  // namespace

extern "C" int main() {
  const selftest::Result result = selftest::run(SPAN_NS, 1);
  write("adapter_bytes ");
  selftest::write_number(write, sizeof(adapter::Adapter));
  write("\n");
  selftest::report(result, write);
  return result.failure == nullptr ? 0 : 1;
}
