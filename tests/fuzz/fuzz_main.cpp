// The program that libFuzzer drives: catgs-fuzz --target=NAME [libFuzzer's options] CORPUS...
// catgs-fuzz --list prints the targets; --target=NAME --write-seeds=DIR writes DIR/seeds/* and
// DIR/words.dict.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <string_view>

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

using Input = std::span<const std::uint8_t>;

/// The length of what is put into `out`; 0, by which libFuzzer tries another mutation, where it has
/// no room.
std::size_t changed(Input input, Input other, std::span<std::uint8_t> out, unsigned seed) {
  std::mt19937_64 random(seed);
  std::string text(input.begin(), input.end());
  const std::string piece(other.begin(), other.end());
  const catgs::fuzz::Material material{random, {&piece, 1}, chosen->dictionary};
  do chosen->change(material, text);
  while (material.one_in(2));
  if (text.size() > out.size()) return 0;
  std::ranges::copy(text, out.begin());
  return text.size();
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

// libFuzzer has it.
extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t max_size, unsigned seed) {
  if (!chosen->change || seed % 2 == 0) return LLVMFuzzerMutate(data, size, max_size);
  return changed({data, size}, {data, size}, {data, max_size}, seed);
}

extern "C" std::size_t LLVMFuzzerCustomCrossOver(const std::uint8_t* data, std::size_t size,
                                                 const std::uint8_t* other, std::size_t other_size,
                                                 std::uint8_t* out, std::size_t max_size,
                                                 unsigned seed) {
  return chosen->change ? changed({data, size}, {other, other_size}, {out, max_size}, seed) : 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    chosen->parse({reinterpret_cast<const std::byte*>(data), size});
  } catch (const catgs::InputError&) {
  }
  return 0;
}
