// The program that libFuzzer drives: catgs-fuzz --target=NAME [libFuzzer's options] CORPUS...
// catgs-fuzz --list prints the targets; --target=NAME --write-seeds=DIR writes DIR/seeds/* and
// DIR/words.dict.
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <optional>

#include <fmt/format.h>

#include "tests/fuzz/target.h"

namespace {

using catgs::fuzz::Target;

const Target* chosen = nullptr;

/// The value of --name=value among the arguments that libFuzzer leaves alone.
std::optional<std::string> option(int argc, char** argv, const std::string& name) {
  const std::string prefix = "--" + name;
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == prefix) return "";
    if (argument.starts_with(prefix + "=")) return std::string(argument.substr(prefix.size() + 1));
  }
  return std::nullopt;
}

void write_seeds(const Target& target, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder / "seeds");
  for (const auto& [name, bytes] : target.seeds())
    std::ofstream(folder / "seeds" / name, std::ios::binary) << bytes;
  std::ofstream words(folder / "words.dict");
  for (const std::string& word : target.dictionary) {
    words << '"';
    for (const unsigned char c : word) words << fmt::format("\\x{:02x}", c);
    words << "\"\n";
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  if (option(*argc, *argv, "list")) {
    for (const Target& target : catgs::fuzz::targets())
      fmt::print("{} {}\n", target.name, target.max_bytes);
    std::exit(0);
  }
  try {
    chosen = &catgs::fuzz::target_called(option(*argc, *argv, "target").value_or(""));
  } catch (const std::exception& error) {
    fmt::print(stderr, "--target: {}\n", error.what());
    std::exit(2);
  }
  if (const auto folder = option(*argc, *argv, "write-seeds")) {
    write_seeds(*chosen, *folder);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    chosen->parse({reinterpret_cast<const std::byte*>(data), size});
  } catch (const catgs::InputError&) {
  }
  return 0;
}
