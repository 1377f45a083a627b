#include <cstring>
#include <sstream>

#include <fmt/format.h>

#include "render_core/scene/formats/decompress.h"
#include "render_core/scene/formats/ksplat.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/formats/ksplat_encoder.h"
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

constexpr std::size_t ksplat_header_bytes = 4096, ksplat_section_bytes = 1024;
constexpr std::size_t ksplat_used_bytes = 44;  // of each of these headers; the rest is 0

/// The headers come without the zeros that fill them.
void parse_ksplat(Bytes input) {
  const auto take = [&](std::size_t filled) {
    const std::size_t used = std::min(ksplat_used_bytes, input.size());
    std::string header = text_of(input.first(used));
    header.resize(filled, '\0');
    input = input.subspan(used);
    return header;
  };
  std::string bytes = take(ksplat_header_bytes);
  std::uint32_t sections = 0;
  std::memcpy(&sections, bytes.data() + 4, sizeof sections);
  for (std::uint32_t i = 0; i < std::min(sections, 8u); ++i) bytes += take(ksplat_section_bytes);
  bytes += text_of(input);
  const MemorySource file("input", bytes_of(bytes));
  const SceneSize size = read_ksplat_size(file);
  const GaussianCloud cloud = read_ksplat(file, one_thread());
  require(cloud.size() == size.gaussians && cloud.sh_degree == size.sh_degree,
          "as many are read as were announced");
  require_sound(cloud);
}

std::map<std::string, std::string> ksplat_seeds() {
  std::map<std::string, std::string> seeds;
  for (const int level : {0, 1, 2})
    for (const int degree : {0, 1, 2}) {
      const test::KsplatStyle style{
          .level = level, .sections = degree == 1 ? 2u : 1u, .bucket_rows = 3};
      const std::string whole = test::encode_ksplat(test::random_cloud(8, degree), style);
      const std::size_t sections = 2 * style.sections - 1;
      std::string seed = whole.substr(0, ksplat_used_bytes);
      for (std::size_t i = 0; i < sections; ++i)
        seed += whole.substr(ksplat_header_bytes + i * ksplat_section_bytes, ksplat_used_bytes);
      seed += whole.substr(ksplat_header_bytes + sections * ksplat_section_bytes);
      seeds[fmt::format("level_{}_{}", level, degree)] = seed;
    }
  return seeds;
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
      {.name = "ksplat",
       .parse = parse_ksplat,
       .seeds = ksplat_seeds,
       .dictionary = {"\xff\xff\xff\xff", std::string("\0\0\x80\x7f", 4)},
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
