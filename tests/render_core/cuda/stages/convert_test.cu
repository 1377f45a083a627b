// Conversion to video, against the formulas on the host.

#include <random>

#include "render_core/cuda/convert.cuh"
#include "render_core/math/colour-inl.h"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

class ConvertStage : public StageTest {};

TEST_F(ConvertStage, MakesTheCodesOfTheFormulas) {
  constexpr int width = 130, height = 66;
  std::mt19937_64 random(51);
  std::vector<float> colours(3 * width * height);
  for (float& c : colours) c = static_cast<float>(random() >> 40) * 0x1p-24f;
  const auto rgb = upload(colours);
  constexpr std::size_t pixels = width * height;
  const auto codes = upload(std::vector<std::uint8_t>(pixels + pixels / 2));
  const Stream stream;
  launch_convert({.width_px = width,
                  .height_px = height,
                  .rgb = rgb.get(),
                  .luma = codes.get(),
                  .cb = codes.get() + pixels,
                  .cr = codes.get() + pixels + pixels / 4},
                 stream.get());
  const std::vector<std::uint8_t> drawn = fetch(codes.get(), pixels + pixels / 2);
  const auto colour = [&](int x, int y) {
    const float* c = &colours[3 * static_cast<std::size_t>(y * width + x)];
    return math::Vec3<double>{c[0], c[1], c[2]};
  };
  Difference code("convert: codes beyond rounding", 1e-3);
  const auto add = [&](std::uint8_t found, double exact) {
    code.add(std::max(0.0, std::abs(found - exact) - 0.5));
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      add(drawn[static_cast<std::size_t>(y * width + x)], math::luma_code(colour(x, y)));
  for (int y = 0; y < height; y += 2) {
    for (int x = 0; x < width; x += 2) {
      math::Vec3<double> mean{0.0, 0.0, 0.0};
      for (int j = 0; j < 4; ++j) {
        const auto c = colour(x + j % 2, y + j / 2);
        mean = {mean.x + 0.25 * c.x, mean.y + 0.25 * c.y, mean.z + 0.25 * c.z};
      }
      const auto chroma = math::chroma_codes<double>(mean);
      const std::size_t at = pixels + static_cast<std::size_t>(y / 2 * (width / 2) + x / 2);
      add(drawn[at], chroma.x);
      add(drawn[at + pixels / 4], chroma.y);
    }
  }
}

}  // namespace
}  // namespace catgs::cuda::stages
