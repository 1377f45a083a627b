#include <cstring>
#include <sstream>

#include <fmt/format.h>

#include "render_core/scene/formats/decompress.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

void parse_splat(Bytes input) {
  require_sound(read_splat(MemorySource("input", input), one_thread()));
}

std::map<std::string, std::string> splat_seeds() {
  std::ostringstream out;
  write_splat(test::random_cloud(5, 0), out);
  std::ostringstream hard;
  write_splat(cloud_hard_to_sort(), hard);
  return {{"five", out.str()}, {"hard_to_sort", hard.str()}};
}

void parse_file(Bytes input) {
  const MemorySource file("input", input);
  if (!is_spz(file)) throw InputError("input", "", "is no .spz");
  read_spz_size(file);
  require_sound(read_spz(file, one_thread()).cloud);
}

/// Versions 1 to 3 are gzip streams, whose checksums would refuse nearly every mutant: their
/// content comes without gzip here, as version 4 does, and is packed now.
void parse_spz(Bytes input) {
  std::uint32_t words[2] = {};
  std::memcpy(words, input.data(), std::min(input.size(), sizeof words));
  constexpr std::uint32_t magic = 0x5053474e;
  if (words[0] != magic || words[1] > 3) return parse_file(input);
  const std::string packed = test::gzip(text_of(input));
  parse_file(bytes_of(packed));
}

std::map<std::string, std::string> spz_seeds() {
  std::map<std::string, std::string> seeds;
  for (const int version : {1, 2, 3, 4})
    for (const int degree : {0, 1, 3}) {
      test::SpzStyle style{.version = version};
      if (degree == 1) style.coordinate_system = 6;
      seeds[fmt::format("v{}_{}", version, degree)] =
          test::encode_spz(test::random_cloud(4, degree), style);
    }
  seeds["v4_hard_to_sort"] = test::encode_spz(cloud_hard_to_sort(), {.version = 4});
  return seeds;
}

std::string unpacked(const std::string& packed) {
  std::string plain(1 << 16, '\0');
  const MemorySource file("seed", bytes_of(packed));
  plain.resize(open_gzip(file)->read_up_to(std::as_writable_bytes(std::span(plain))));
  return plain;
}

/// The same with versions 1 to 3 as parse_spz() takes them; one of each stays packed.
std::map<std::string, std::string> unpacked_spz_seeds() {
  auto seeds = spz_seeds();
  for (auto& [name, bytes] : seeds)
    if (name[1] != '4' && name[3] != '0') bytes = unpacked(bytes);
  return seeds;
}

}  // namespace

std::vector<Target> splat_spz_targets() {
  return {
      {.name = "splat",
       .parse = parse_splat,
       .seeds = splat_seeds,
       .dictionary = {"\xff\xff\xff\x7f", std::string("\0\0\x80\x7f", 4)},
       .max_bytes = 2048},
      {.name = "spz",
       .parse = parse_spz,
       .seeds = unpacked_spz_seeds,
       .dictionary = {"NGSP", "\x1f\x8b", std::string("\1\0\0\0", 4), std::string("\2\0\0\0", 4),
                      std::string("\3\0\0\0", 4), std::string("\4\0\0\0", 4),
                      std::string("\x28\xb5\x2f\xfd", 4), "\xff\xff\xff\xff"},
       .max_bytes = 2048}};
}

}  // namespace catgs::fuzz
