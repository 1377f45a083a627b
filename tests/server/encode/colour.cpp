#include "tests/server/encode/colour.h"

#include <algorithm>

namespace catgs::test {

glm::dvec3 video_codes(glm::dvec3 rgb) {
  const double luma = 0.2126 * rgb.r + 0.7152 * rgb.g + 0.0722 * rgb.b;
  return {16 + 219.0 / 255 * luma, 128 + 224.0 / 255 * (rgb.b - luma) / 1.8556,
          128 + 224.0 / 255 * (rgb.r - luma) / 1.5748};
}

glm::dvec3 rgb_at(const DecodedPicture& picture, glm::ivec2 pixel) {
  const auto at = [](glm::ivec2 place, int width) {
    return static_cast<std::size_t>(place.y) * static_cast<std::size_t>(width) +
           static_cast<std::size_t>(place.x);
  };
  const std::size_t luma_at = at(pixel, picture.size_px.x);
  const std::size_t chroma_at = at(pixel / 2, (picture.size_px.x + 1) / 2);
  double luma = picture.planes[0][luma_at];
  double cb = picture.planes[1][chroma_at] - 128.0;
  double cr = picture.planes[2][chroma_at] - 128.0;
  glm::dvec3 rgb;
  if (picture.full_range) {  // BT.601, as JFIF prescribes
    rgb = {luma + 1.402 * cr, luma - 0.344136 * cb - 0.714136 * cr, luma + 1.772 * cb};
  } else {  // BT.709
    luma = (luma - 16) * 255 / 219;
    cb *= 255.0 / 224;
    cr *= 255.0 / 224;
    rgb = {luma + 1.5748 * cr, luma - 0.187324 * cb - 0.468124 * cr, luma + 1.8556 * cb};
  }
  return {std::clamp(rgb.r, 0.0, 255.0), std::clamp(rgb.g, 0.0, 255.0),
          std::clamp(rgb.b, 0.0, 255.0)};
}

}  // namespace catgs::test
