// The program for libFuzzer: fuzz --target=NAME [OPTIONS OF LIBFUZZER] [CORPUS…]

#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <string_view>

#include "target.hpp"

namespace {

const urban_gnss::fuzz::Target* chosen = nullptr;

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  constexpr std::string_view kOption = "--target=";  // libFuzzer leaves options with two dashes to us
  for (int i = 1; i < *argc; ++i) {
    const std::string_view argument = (*argv)[i];
    if (argument.substr(0, kOption.size()) != kOption) continue;
    for (const auto& target : urban_gnss::fuzz::targets()) {
      if (target.name == argument.substr(kOption.size())) chosen = &target;
    }
  }
  if (chosen != nullptr) return 0;
  std::cerr << "fuzz: --target must be one of";
  for (const auto& target : urban_gnss::fuzz::targets()) std::cerr << ' ' << target.name;
  std::cerr << '\n';
  std::exit(2);
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  chosen->run(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
