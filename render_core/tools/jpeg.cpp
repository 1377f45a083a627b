#include <algorithm>
#include <memory>
#include <vector>

#include <fmt/format.h>
#include <turbojpeg.h>

#include "render_core/base/error.h"
#include "render_core/frame/renderer.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/tools/picture.h"

namespace catgs {
namespace {

constexpr std::uint64_t max_file_bytes = std::uint64_t{256} << 20;

struct Destroy {
  void operator()(void* decoder) const { tjDestroy(decoder); }
};

}  // namespace

Image read_jpeg(const std::filesystem::path& path) {
  const std::vector<std::byte> file = FileSource(path).read_all(max_file_bytes);
  const auto* data = reinterpret_cast<const unsigned char*>(file.data());
  const std::unique_ptr<void, Destroy> decoder(tjInitDecompress());
  Image image;
  int sampling = 0, colours = 0;
  glm::ivec2& size = image.size_px;
  bool good = tjDecompressHeader3(decoder.get(), data, file.size(), &size.x, &size.y, &sampling,
                                  &colours) == 0 &&
              std::max(size.x, size.y) <= max_image_side_px;
  std::vector<unsigned char> rgb(good ? std::size_t{3} * size.x * size.y : 0);
  constexpr int flags = TJFLAG_ACCURATEDCT | TJFLAG_STOPONWARNING;  // damage is a warning
  good = good && tjDecompress2(decoder.get(), data, file.size(), rgb.data(), size.x, 0, size.y,
                               TJPF_RGB, flags) == 0;
  if (!good)
    throw InputError(path.string(), "", "is damaged, too large, or no JPEG of a camera",
                     fmt::format("grey or colour, at most {0}x{0} pixels", max_image_side_px));
  image.rgb.resize(rgb.size());
  std::ranges::transform(rgb, image.rgb.begin(),
                         [](unsigned char value) { return static_cast<float>(value) / 255.0f; });
  return image;
}

}  // namespace catgs
