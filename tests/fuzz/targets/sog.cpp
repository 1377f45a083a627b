#include "render_core/scene/sog.h"

#include <algorithm>
#include <cstring>
#include <memory>

#include <fmt/format.h>

#include "render_core/scene/file_set.h"
#include "render_core/scene/sog_image.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/encoders.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

/// Files of a folder one after the other: name, 0, size (3 bytes), content. A zip archive's
/// checksums would refuse nearly every mutant.
std::string packed(const std::map<std::string, std::string>& files) {
  std::string bytes;
  for (const auto& [name, content] : files) {
    const auto size = static_cast<std::uint32_t>(content.size());
    bytes.append(name).push_back('\0');
    bytes.append(reinterpret_cast<const char*>(&size), 3).append(content);
  }
  return bytes;
}

class PackedFiles final : public FileSet {
 public:
  explicit PackedFiles(Bytes bytes) {
    while (!bytes.empty()) {
      const auto name_end = std::find(bytes.begin(), bytes.end(), std::byte{0});
      const std::string name = text_of({bytes.begin(), name_end});
      bytes = bytes.subspan(std::min(bytes.size(), name.size() + 1));
      std::uint32_t size = 0;
      const std::size_t prefix = std::min<std::size_t>(3, bytes.size());
      std::memcpy(&size, bytes.data(), prefix);
      bytes = bytes.subspan(prefix);
      files_[name] = bytes.first(std::min<std::size_t>(size, bytes.size()));
      bytes = bytes.subspan(files_[name].size());
    }
  }
  [[nodiscard]] std::unique_ptr<ByteSource> open(const std::string& name) const override {
    const auto found = files_.find(name);
    if (found == files_.end()) throw InputError(name, "", "is missing");
    return std::make_unique<MemorySource>(name, found->second);
  }

 private:
  std::map<std::string, Bytes> files_;
};

void parse_sog(Bytes input) {
  require_sound(read_sog(PackedFiles(input), "meta.json", one_thread()).cloud);
}

std::map<std::string, std::string> sog_seeds() {
  std::map<std::string, std::string> seeds;
  for (const int version : {1, 2})
    for (const int degree : {0, 1, 3})
      seeds[fmt::format("v{}_{}", version, degree)] =
          packed(test::encode_sog(test::random_cloud(4, degree), version));
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
          {"noise", test::encode_webp(noise, 16, 4)}};
}

}  // namespace

Target sog() {
  return {.name = "sog",
          .parse = parse_sog,
          .seeds = sog_seeds,
          .dictionary = {"\"version\":",      "\"count\":",   "\"means\":",  "\"shape\":",
                         "\"mins\":",         "\"maxs\":",    "\"scales\":", "\"codebook\":",
                         "\"sh0\":",          "\"shN\":",     "\"bands\":",  "\"files\":",
                         "\"quats\":",        "null",         "1e39",        "meta.json",
                         "means_l.webp",      "means_u.webp", "quats.webp",  "scales.webp",
                         "sh0.webp",          "RIFF",         "WEBPVP8L",    "shN_labels.webp",
                         "shN_centroids.webp"},
          .max_bytes = 16384};
}

Target zip() {
  return {.name = "zip",
          .parse = parse_zip,
          .seeds = zip_seeds,
          .dictionary = {"PK\3\4", "PK\1\2", "PK\5\6", "PK\6\6", "PK\6\7", "PK\7\10", "meta.json",
                         std::string("\10\0", 2), std::string("\1\0", 2), "../"},
          .max_bytes = 2048};
}

Target webp() {
  return {.name = "webp",
          .parse = parse_webp,
          .seeds = webp_seeds,
          .dictionary = {"RIFF", "WEBP", "VP8L", "VP8X", "VP8 ", "ALPH", "ANIM", "ANMF", "ICCP",
                         "EXIF"},
          .max_bytes = 1024};
}

}  // namespace catgs::fuzz
