// Damaged files must give a cloud or an InputError, whatever the damage: no crash, no other
// exception, no memory beyond the file's means. Fuzzers go on where this stops.
#include <random>

#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

using Parser = std::function<void(const ByteSource&)>;

void judge(GaussianCloud cloud) {
  ASSERT_EQ(cloud.sh.size(), cloud.size() * static_cast<std::size_t>(cloud.sh_count()));
  sanitize(cloud, two_threads());
}

void parse_ply(const ByteSource& file) {
  const PlyHeader header = read_ply_header(file);
  judge(is_compressed_ply(header) ? read_compressed_ply(file, header, two_threads())
                                  : read_ply(file, header, two_threads()));
}

/// Overwrites, inserts, removes or cuts, most often near the front where the headers are.
std::string damaged(std::string bytes, std::mt19937& random) {
  const auto below = [&](std::size_t n) { return random() % std::max<std::size_t>(1, n); };
  for (std::size_t changes = 1 + below(4); changes > 0 && !bytes.empty(); --changes) {
    const std::size_t at =
        below(below(3) == 0 ? bytes.size() : std::min<std::size_t>(400, bytes.size()));
    switch (below(6)) {
      case 0:
        bytes.resize(at);
        break;
      case 1:
        bytes.insert(at, 1 + below(8), static_cast<char>(random()));
        break;
      case 2:
        bytes.erase(at, 1 + below(8));
        break;
      case 3:
        for (std::size_t k = at; k < std::min(bytes.size(), at + 4); ++k) bytes[k] = '\xff';
        break;
      default:
        bytes[at] = static_cast<char>(random());
    }
  }
  return bytes;
}

void expect_no_surprise(const std::string& bytes, const Parser& parse, int rounds) {
  std::mt19937 random(7);
  int refused = 0;
  for (int round = 0; round < rounds; ++round) {
    const std::string mutant = damaged(bytes, random);
    try {
      parse(MemorySource("mutant", bytes_of(mutant)));
    } catch (const InputError&) {
      ++refused;
    } catch (const std::exception& e) {
      ADD_FAILURE() << "round " << round << ": " << e.what();
    }
  }
  EXPECT_GT(refused, rounds / 20);  // the damage does reach the parser
}

TEST(Mutation, Ply) {
  std::ostringstream out;
  write_ply(random_cloud(50, 1), out);
  expect_no_surprise(out.str(), parse_ply, 1000);
  std::string ascii = "ply\nformat ascii 1.0\nelement vertex 2\n";
  for (const char* name : {"x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0",
                           "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"})
    ascii += std::string("property float ") + name + "\n";
  ascii += "end_header\n";
  for (int k = 0; k < 28; ++k) ascii += "-0.5e-1 ";
  expect_no_surprise(ascii, parse_ply, 1000);
}

TEST(Mutation, CompressedPly) {
  expect_no_surprise(encode_compressed_ply(random_cloud(300, 1), true), parse_ply, 1000);
}

TEST(Mutation, Splat) {
  std::ostringstream out;
  write_splat(random_cloud(50, 0), out);
  expect_no_surprise(
      out.str(), [](const ByteSource& file) { judge(read_splat(file, two_threads())); }, 500);
}

TEST(Mutation, Spz) {
  const Parser parse = [](const ByteSource& file) { judge(read_spz(file, two_threads()).cloud); };
  const GaussianCloud cloud = random_cloud(50, 1);
  expect_no_surprise(encode_spz(cloud, {.version = 4, .coordinate_system = 6}), parse, 1000);
  for (const int version : {1, 2, 3})
    expect_no_surprise(encode_spz(cloud, {.version = version, .coordinate_system = 6}), parse, 300);
  // gzip protects its content with a checksum only at the very end: damage what is inside, too.
  std::string inside(16, '\0');
  const std::uint32_t words[] = {0x5053474e, 3, 4};
  std::memcpy(inside.data(), words, sizeof words);
  inside.append(200, 'x');
  expect_no_surprise(
      inside,
      [&](const ByteSource& file) {
        const auto bytes = file.read_all(1 << 20);
        const std::string packed =
            gzip(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
        parse(MemorySource("mutant", bytes_of(packed)));
      },
      1000);
}

TEST(Mutation, Sog) {
  const Parser parse = [](const ByteSource& file) {
    judge(read_sog(ZipFiles(file), "meta.json", two_threads()).cloud);
  };
  for (const int version : {1, 2}) {
    const auto files = encode_sog(random_cloud(60, 1), version);
    expect_no_surprise(zip(files), parse, 500);
    for (const auto& [name, content] : files) {
      auto mutants = files;
      expect_no_surprise(
          content,
          [&](const ByteSource& file) {
            const auto bytes = file.read_all(1 << 20);
            mutants[name].assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
            const std::string archive = zip(mutants);
            parse(MemorySource("mutant", bytes_of(archive)));
          },
          200);
    }
  }
}

TEST(Mutation, JsonFiles) {
  expect_no_surprise(
      R"({"version":1,"lodLevels":2,"environment":null,"filenames":["0_0/meta.json"],"tree":{"children":
         [{"lods":{"0":{"file":0,"offset":0,"count":9},"1":{"file":0,"offset":9,"count":4}}}]}})",
      [](const ByteSource& file) { choose_within_budget(read_lod_tree(file), 10); }, 2000);
  expect_no_surprise(R"({"up":"+z","near":0.05,"focus":[1,2,3],"start_pose":{"position":[4,5,6],
                         "look_at":[0,0,0]},"limits":{"min":[0,0,0],"max":[1,1,1]}})",
                     [](const ByteSource& file) { read_sidecar(file); }, 2000);
  expect_no_surprise(R"([{"position":[-3,0,0],"rotation":[[0,0,1],[0,1,0],[-1,0,0]]}])",
                     [](const ByteSource& file) { read_cameras_json(file); }, 2000);
}

}  // namespace
}  // namespace catgs::test
