#include "render_core/scene/formats/sog.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/sog_image.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "tests/fuzz/target.h"
#include "tests/fuzz/targets/packed_files.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

/// An image of a few colours. Values 252 to 255 are tags of rotations in the fourth channel.
std::string any_image(const Material& from) {
  constexpr std::array<int, 9> widths = {1, 2, 3, 4, 16, 64, 192, 512, 960};
  constexpr std::array<int, 6> heights = {1, 2, 4, 64, 1024, 1025};
  constexpr std::array<std::uint8_t, 9> edges = {0, 1, 127, 128, 251, 252, 253, 254, 255};
  const int width = from.any_of(widths);
  const int height = width > 64 ? 1 : from.any_of(heights);
  std::array<char, 16> colours{};
  for (char& c : colours)
    c = static_cast<char>(from.one_in(2) ? from.any_of(edges) : from.below(256));
  std::string rgba;
  for (int i = 0; i < width * height; ++i) rgba.append(&colours[4 * from.below(4)], 4);
  return test::encode_webp(rgba, width, height, !from.one_in(8));
}

/// One of the files, as its format has it.
void change_sog(const Material& from, std::string& text) {
  std::map<std::string, std::string> files;
  for (const auto& [name, content] : unpacked(bytes_of(text))) files[name] = text_of(content);
  const auto others = unpacked(bytes_of(from.any_of(from.inputs)));
  if (files.empty() || others.empty()) return change_bytes(from, text);
  const auto any = [&](auto& map) {
    return std::next(map.begin(), static_cast<std::ptrdiff_t>(from.below(map.size())));
  };
  if (from.one_in(2)) {
    const std::string meta = files.contains("lod-meta.json") ? "lod-meta.json" : "meta.json";
    const auto other = others.find(meta);
    const std::string piece = text_of(other == others.end() ? any(others)->second : other->second);
    change_json({from.random, {&piece, 1}, from.words}, files[meta]);
    text = packed(files);
    return;
  }
  std::string& content = any(files)->second;
  switch (from.below(8)) {
    case 0:
      files.erase(any(files));
      break;
    case 1: {
      const auto other = any(others);
      files[other->first] = text_of(other->second);
      break;
    }
    case 2:
      content = text_of(any(others)->second);
      break;
    case 3:
      content = any_image(from);
      break;
    default:
      change_bytes(from, content);
      break;
  }
  text = packed(files);
}

void parse_sog(Bytes input) {
  require_sound(read_sog(PackedFiles(input), "meta.json", one_thread()).cloud);
}

/// A folder with lod-meta.json and the SOGs that it takes its Gaussians from.
void parse_streamed_sog(Bytes input) {
  const PackedFiles files(input);
  const LodTree tree = read_lod_tree(*files.open("lod-meta.json"));
  bool read = false;
  for (const std::optional<std::size_t> budget : {std::optional<std::size_t>(), {20}}) try {
      const std::size_t count = count_streamed_sog(files, {}, budget);
      require(!budget || count <= *budget, "a budget is kept");
      const GaussianCloud cloud =
          read_streamed_sog(files, open_streamed_sog(files, {}, budget), one_thread());
      require(cloud.size() == count, "as many are read as were counted");
      require_sound(cloud);
      read = true;
    } catch (const InputError&) {
    }
  if (!read) throw InputError("input", "", "is no scene");
}

std::map<std::string, std::string> streamed_sog_seeds() {
  const auto folder = [](std::string tree, const std::string& environment) {
    std::map<std::string, std::string> files = {{"lod-meta.json", std::move(tree)}};
    for (const auto& [name, content] : test::encode_sog(test::random_cloud(9, 1), 1))
      files["a/" + name] = content;
    files["b.sog"] = test::zip(test::encode_sog(test::random_cloud(4, 0), 1));
    if (!environment.empty()) files[environment] = files["b.sog"];
    return packed(files);
  };
  return {{"two_levels", folder(R"({"lodLevels":2,"filenames":["a/meta.json","b.sog"],"tree":{
             "children":[{"lods":{"0":{"file":0,"offset":0,"count":5},"1":{"file":1,"offset":0,
             "count":2}}},{"lods":{"0":{"file":0,"offset":5,"count":4},"1":{"file":1,"offset":2,
             "count":2}}}]}})",
                                "")},
          {"environment", folder(R"({"lodLevels":1,"environment":"c.sog","filenames":
             ["a/meta.json"],"tree":{"lods":{"0":{"file":0,"offset":2,"count":6}}}})",
                                 "c.sog")}};
}

std::map<std::string, std::string> sog_seeds() {
  std::map<std::string, std::string> seeds;
  for (const int version : {1, 2})
    for (const int degree : {0, 1, 2, 3})
      seeds[fmt::format("v{}_{}", version, degree)] =
          packed(test::encode_sog(test::random_cloud(4, degree), version));
  seeds["hard_to_sort"] = packed(test::encode_sog(cloud_hard_to_sort(), 2));
  return seeds;
}

void parse_zip(Bytes input) {
  const MemorySource archive("input", input);
  const ZipFiles one(archive, "meta.json");
  const ZipFiles all(archive);
  const auto meta = all.open("meta.json");
  require(one.open("meta.json")->size() == meta->size(), "an entry alone is the same entry");
  require(meta->size() <= 4 * input.size() + (1 << 20), "archives grow at most fourfold");
}

std::map<std::string, std::string> zip_seeds() {
  const std::map<std::string, std::string> files = {
      {"meta.json", R"({"version":2,"count":1,"a":[0,0,0,0,0,0,0,0]})"}, {"a/b.webp", "RIFF"}};
  return {{"stored", test::zip(files)}, {"deflated", test::zip(files, true)}};
}

void parse_webp(Bytes input) {
  const MemorySource file("input", input);
  // As read_sog_meta() does: an image is decoded when its size fits the count of Gaussians.
  if (sog_image_size(file).texels() > 1 << 20)
    throw InputError("input", "", "more texels than Gaussians");
  const SogImage image = read_sog_image(file);
  require(image.rgba.size() == 4 * std::size_t{image.width} * image.height, "a whole image");
}

std::map<std::string, std::string> webp_seeds() {
  std::string noise;
  for (int i = 0; i < 4 * 64; ++i) noise.push_back(static_cast<char>(i * i * 37));
  return {{"flat", test::encode_webp(std::string(4 * 64, '\7'), 8, 8)},
          {"noise", test::encode_webp(noise, 16, 4)},
          {"png", test::encode_png(noise, 16, 4)},
          {"png_rgb", test::encode_png(noise, 8, 8, false)}};
}

}  // namespace

std::vector<Target> sog_targets() {
  return {
      {.name = "sog",
       .parse = parse_sog,
       .seeds = sog_seeds,
       .dictionary = words_of(
           R"("version": "count": "means": "shape": "mins": "maxs": "scales": "codebook": "sh0": "shN":
               "bands": "files": "quats": null 1e39 meta.json means_l.webp means_u.webp quats.webp
               scales.webp sh0.webp RIFF WEBPVP8L shN_labels.webp shN_centroids.webp)"),
       .change = change_sog,
       .max_bytes = 16384},
      {.name = "streamed_sog",
       .parse = parse_streamed_sog,
       .seeds = streamed_sog_seeds,
       .dictionary = words_of(
           R"("lodLevels": "filenames": "tree": "children": "lods": "file": "offset": "count":
               "environment": lod-meta.json a/meta.json b.sog c.sog)"),
       .change = change_sog,
       .max_bytes = 16384},
      {.name = "zip",
       .parse = parse_zip,
       .seeds = zip_seeds,
       .dictionary = {"PK\3\4", "PK\1\2", "PK\5\6", "PK\6\6", "PK\6\7", "PK\7\10", "meta.json",
                      std::string("\10\0", 2), std::string("\1\0", 2), "../"},
       .max_bytes = 2048},
      {.name = "webp",
       .parse = parse_webp,
       .seeds = webp_seeds,
       .dictionary = {"RIFF", "WEBP", "VP8L", "VP8X", "VP8 ", "ALPH", "ANIM", "ANMF", "ICCP",
                      "EXIF"},
       .max_bytes = 1024}};
}

}  // namespace catgs::fuzz
