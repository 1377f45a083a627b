#include "render_core/tools/picture.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <string_view>

#include "render_core/image/png.h"

namespace catgs {

bool is_picture(const std::filesystem::path& path) {
  constexpr std::array<std::string_view, 6> extensions = {".png", ".jpg", ".jpeg",
                                                          ".PNG", ".JPG", ".JPEG"};
  return std::ranges::find(extensions, path.extension().string()) != extensions.end();
}

Image read_picture(const std::filesystem::path& path) {
  std::array<char, 2> start{};
  std::ifstream(path, std::ios::binary).read(start.data(), start.size());
  return start == std::array{'\xff', '\xd8'} ? read_jpeg(path) : read_png(path);
}

}  // namespace catgs
