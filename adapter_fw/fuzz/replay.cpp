// Reads kept inputs again without a fuzzer: `replay FILE…`; a finding aborts, silence is success.

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

int main(int count, char** paths) {
  for (int place = 1; place < count; ++place) {
    std::FILE* file = std::fopen(paths[place], "rb");
    if (file == nullptr) {
      std::fprintf(stderr, "replay: cannot open %s\n", paths[place]);
      return 2;
    }
    std::vector<std::uint8_t> data;
    for (int byte = std::fgetc(file); byte != EOF; byte = std::fgetc(file)) {
      data.push_back(static_cast<std::uint8_t>(byte));
    }
    std::fclose(file);
    LLVMFuzzerTestOneInput(data.data(), data.size());
  }
  std::printf("%d inputs, nothing found\n", count - 1);
  return 0;
}
