#include "tests/load/picture_check.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"
#include "render_core/metrics/image_quality.h"
#include "server/base/scene_id.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_ids.h"

namespace catgs::load {
namespace {

/// How R, G and B depend on luma and chroma codes.
struct Matrix {
  double luma_offset, luma_scale, chroma_scale;
  double red_weight, blue_weight;  // of luma: the rest is green's
};
constexpr Matrix bt709_limited{16.0, 1.0 / 219.0, 1.0 / 224.0, 0.2126, 0.0722};
constexpr Matrix jfif{0.0, 1.0 / 255.0, 1.0 / 255.0, 0.299, 0.114};

double squared_error(const FrameView& truth, const std::vector<float>& shown) {
  double sum = 0.0;
  const auto row_values = static_cast<std::size_t>(truth.size_px.x) * 3;
  for (int y = 0; y < truth.size_px.y; ++y) {
    const auto* row = reinterpret_cast<const float*>(
        truth.planes[0].data + static_cast<std::size_t>(y) * truth.planes[0].stride_bytes);
    const float* other = shown.data() + static_cast<std::size_t>(y) * row_values;
    for (std::size_t i = 0; i < row_values; ++i) {
      const double error = static_cast<double>(row[i]) - static_cast<double>(other[i]);
      sum += error * error;
    }
  }
  return sum / static_cast<double>(shown.size());
}

}  // namespace

std::vector<float> rgb_of(const DecodedPicture& picture) {
  const Matrix& m = picture.full_range ? jfif : bt709_limited;
  const auto width = static_cast<std::size_t>(picture.size_px.x);
  const auto height = static_cast<std::size_t>(picture.size_px.y);
  const std::size_t chroma_width = (width + 1) / 2;
  const double green_weight = 1.0 - m.red_weight - m.blue_weight;
  std::vector<float> rgb;
  rgb.reserve(3 * width * height);
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t chroma = y / 2 * chroma_width + x / 2;
      const double luma = (picture.planes[0][y * width + x] - m.luma_offset) * m.luma_scale;
      const double cb = (picture.planes[1][chroma] - 128.0) * m.chroma_scale;
      const double cr = (picture.planes[2][chroma] - 128.0) * m.chroma_scale;
      const double red = luma + 2.0 * (1.0 - m.red_weight) * cr;
      const double blue = luma + 2.0 * (1.0 - m.blue_weight) * cb;
      const double green = (luma - m.red_weight * red - m.blue_weight * blue) / green_weight;
      for (const double value : {red, green, blue})
        rgb.push_back(static_cast<float>(std::clamp(value, 0.0, 1.0)));
    }
  }
  return rgb;
}

void check_pictures(const std::string& scene, RunReport& report) {
  ServerConfig config;
  config.scenes = {scene};
  RendererOptions core;
  core.pool = std::make_shared<ThreadPool>(0);
  const SceneIds ids(config.scenes, {});
  const auto entry = load_scene(
      locate_scenes(config).front(), {},
      [&](const std::string& name) { return ids.id_of(scene, name); }, config, core,
      core.pool->threads());
  const auto view = entry->renderer->make_view({Pipeline::exact, PixelFormat::rgb_f32});
  for (GroupReport& group : report.groups) {
    for (const auto& session : group.sessions) {
      for (PictureSample& sample : session->pictures) {
        // The server may have the same scene in another folder.
        if (name_in(sample.scene_id) != name_in(entry->facts.scene_id)) {
          throw InputError("--check-scene", scene,
                           fmt::format("is \"{}\", but a session saw \"{}\"", entry->facts.scene_id,
                                       sample.scene_id));
        }
        FrameRequest request;
        const glm::ivec2 size_px = sample.picture.size_px;
        request.camera = make_camera(sample.render_pose, size_px,
                                     focal_from_fov_y(sample.fov_y_rad, size_px.y), sample.near_z);
        FrameView truth;
        const RenderStatus status = view->render(request, truth);
        if (!status.ok()) throw std::runtime_error(status.message);
        sample.psnr_db = psnr_db(squared_error(truth, rgb_of(sample.picture)));
      }
    }
  }
}

}  // namespace catgs::load
