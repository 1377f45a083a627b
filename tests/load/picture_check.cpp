#include "tests/load/picture_check.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "render_core/base/error.h"
#include "render_core/frame/renderer.h"
#include "render_core/image/png.h"
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

}  // namespace

Image rgb_of(const DecodedPicture& picture) {
  const Matrix& m = picture.full_range ? jfif : bt709_limited;
  const auto width = static_cast<std::size_t>(picture.size_px.x);
  const auto height = static_cast<std::size_t>(picture.size_px.y);
  const std::size_t chroma_width = (width + 1) / 2;
  const double green_weight = 1.0 - m.red_weight - m.blue_weight;
  Image image{picture.size_px, {}};
  image.rgb.reserve(3 * width * height);
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
        image.rgb.push_back(static_cast<float>(std::clamp(value, 0.0, 1.0)));
    }
  }
  return image;
}

double mean_squared_error(const Image& a, const Image& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.rgb.size(); ++i) {
    const double error = static_cast<double>(a.rgb[i]) - static_cast<double>(b.rgb[i]);
    sum += error * error;
  }
  return sum / static_cast<double>(a.rgb.size());
}

std::string scene_name(const std::string& scene) {
  if (!is_synthetic(scene)) return scene_name_of(locate_scene(scene).name);
  const std::size_t kind = scene.find(':') + 1;
  return scene.substr(kind, scene.find(':', kind) - kind);
}

struct ExactPictures::Loaded {
  std::string scene_id;  // as sessions say it
  std::shared_ptr<const SceneEntry> entry;
  std::unique_ptr<View> view;
};

ExactPictures::ExactPictures(std::vector<std::string> scenes)
    : scenes_(std::move(scenes)), pool_(std::make_shared<ThreadPool>(0)) {}

ExactPictures::~ExactPictures() = default;

void ExactPictures::load(const std::string& scene_id) {
  // The server may have the same scene in another folder.
  const auto found = std::ranges::find(scenes_, name_in(scene_id), scene_name);
  if (found == scenes_.end()) {
    throw InputError("--check-scene", fmt::format("{}", fmt::join(scenes_, ", ")),
                     fmt::format("is not \"{}\", which a session saw", scene_id));
  }
  ServerConfig config;
  config.scenes = {*found};
  RendererOptions core;
  core.pool = pool_;
  loaded_.reset();
  auto entry = load_scene(
      locate_scenes(config).front(), {}, [&](const std::string&) { return scene_id; }, config, core,
      pool_->threads());
  auto view = entry->renderer->make_view({Pipeline::exact, PixelFormat::rgb_f32});
  loaded_ = std::make_unique<Loaded>(scene_id, std::move(entry), std::move(view));
}

Image ExactPictures::draw(const std::string& scene_id, const Camera& camera,
                          const std::optional<Stereo>& stereo) {
  if (!loaded_ || loaded_->scene_id != scene_id) load(scene_id);
  FrameRequest request;
  request.camera = camera;
  request.stereo = stereo;
  FrameView truth;
  const RenderStatus status = loaded_->view->render(request, truth);
  if (!status.ok()) throw std::runtime_error(status.message);
  return copy_image(truth);
}

void check_pictures(const std::vector<std::string>& scenes, RunReport& report) {
  ExactPictures exact(scenes);
  for (GroupReport& group : report.groups) {
    for (const auto& session : group.sessions) {
      for (PictureSample& sample : session->pictures) {
        const glm::ivec2 size_px = sample.picture.size_px;
        const Camera camera =
            make_camera(sample.render_pose, size_px, focal_from_fov_y(sample.fov_y_rad, size_px.y),
                        sample.near_z);
        const Image truth = exact.draw(sample.scene_id, camera, sample.stereo);
        sample.psnr_db = psnr_db(mean_squared_error(truth, rgb_of(sample.picture)));
      }
    }
  }
}

}  // namespace catgs::load
