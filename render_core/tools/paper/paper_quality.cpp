// The paper's table about quality: key frames and sub-frames against the exact pipeline, or against
// the photographs that the scene was trained on.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/image/png.h"
#include "render_core/scene/formats/colmap.h"
#include "render_core/tools/frame_feed.h"
#include "render_core/tools/paper/paper_tables.h"
#include "render_core/tools/picture.h"
#include "render_core/tools/progress.h"

namespace catgs {
namespace {

PaperTable::Row quality_row(std::string name, const QualityTally& tally) {
  if (tally.frames() == 0) return {std::move(name), std::vector<Number>(3)};
  return {std::move(name), {{tally.mean_psnr(), 2}, {tally.mean_ssim(), 4}, {tally.min_psnr(), 2}}};
}

std::vector<std::string> quality_columns(const std::string& label) {
  return {label + " PSNR", label + " SSIM", label + " worst PSNR"};
}

std::filesystem::path find_photo(const std::filesystem::path& folder, const std::string& name) {
  const std::filesystem::path file = folder / name;
  std::error_code error;
  if (is_picture(file) && std::filesystem::exists(file, error)) return file;
  for (const char* extension : {".png", ".jpg", ".jpeg", ".JPG", ".JPEG", ".PNG"}) {
    const auto other = std::filesystem::path(file).replace_extension(extension);
    if (std::filesystem::exists(other, error)) return other;
  }
  throw InputError(file.string(), "", "does not exist",
                   "photographs are PNG or JPEG, of the names that COLMAP knows");
}

/// Renders a camera path through the poses of the photographs, and compares it with them.
class PhotoJudge {
 public:
  explicit PhotoJudge(PaperCase& scene)
      : scene_(scene),
        folder_(std::filesystem::path(scene.images()) / scene.options().image_folder),
        images_(read_colmap(scene.images(), Distortion::refused, scene.setup().scene.hints.origin)),
        pool_(*scene.setup().pool) {
    for (Row& row : rows_) {
      row.view = scene.setup().made.renderer->make_view(scene.settings(row.variant));
    }
  }

  /// Renders the frames from one photograph to the next. The poses between are interpolated, but
  /// forecasts know only the poses of the photographs passed so far.
  int follow_path() {
    const PaperOptions& options = scene_.options();
    const double rate_hz = options.render.fps.value_or(120.0);
    const int steps = std::max(1, static_cast<int>(std::lround(rate_hz / options.image_rate_hz)));
    Trajectory samples, poses;
    for (std::size_t k = 0; k < images_.size(); ++k) {
      const double seconds = static_cast<double>(k) / options.image_rate_hz;
      samples.push_back({std::llround(1e6 * seconds), images_[k].world_from_camera});
      for (int step = k == 0 ? steps : 1; step <= steps; ++step) {
        const std::int64_t before_us = k == 0 ? 0 : samples[k - 1].time_us;
        const std::int64_t time_us = before_us + (samples[k].time_us - before_us) * step / steps;
        poses.push_back({time_us, interpolate(samples, time_us)});
      }
    }
    scene_.follow(std::move(samples), std::move(poses), options.image_rate_hz * steps);
    return steps;
  }

  void run() {
    const int steps = follow_path();
    FrameFeed feed(scene_.setup(), scene_.settings(variants::paper));
    Progress progress(scene_.label() + ": photographs", scene_.quiet());
    glm::vec2 scale(1.0f);  // from COLMAP's pictures to the photographs
    for (std::size_t k = 0; k < images_.size(); ++k) {
      const bool judged = k % scene_.options().llffhold == 0;
      Image photo;
      if (judged) {
        photo = read_picture(find_photo(folder_, images_[k].name));
        scale = glm::vec2(photo.size_px) / glm::vec2(images_[k].lens.size_px);
      }
      // A photograph between test views only moves the camera. Its size need not be read.
      const glm::ivec2 size_px =
          judged ? photo.size_px
                 : glm::ivec2(glm::round(scale * glm::vec2(images_[k].lens.size_px)));
      const Camera camera = make_camera(images_[k].lens, glm::max(size_px, 1));
      FrameView frame;
      for (int step = k == 0 ? steps : 1; step <= steps; ++step) {
        FrameRequest request = feed.next();
        request.camera = with_pose(camera, request.camera.world_from_camera);
        render_or_throw(*sub_.view, request, frame);
      }
      if (judged && frame.stats.kind == FrameKind::sub) sub_.picture = copy_image(frame);
      if (judged) judge(k, photo, camera);
      progress.update(static_cast<double>(k + 1) / static_cast<double>(images_.size()));
    }
  }

  [[nodiscard]] PaperTable table() const {
    PaperTable table{
        .columns = quality_columns(scene_.label()),
        .notes = {fmt::format(
            "{}: against {} of {} photographs (llffhold {}) of {}; {} of them were reached by a "
            "sub-frame at {:g} photographs a second.",
            scene_.label(), scene_.photos.size(), images_.size(), scene_.options().llffhold,
            sizes_of(scene_.photos), sub_.tally.frames(), scene_.options().image_rate_hz)}};
    for (const Row& row : rows_) table.rows.push_back(quality_row(row.name, row.tally));
    return table;
  }

 private:
  struct Row {
    std::string name;
    Variant variant;
    QualityTally tally{};
    std::unique_ptr<View> view{};
    Image picture{};  // the sub-frame to be judged, if any
  };

  [[nodiscard]] Camera with_pose(Camera camera, const Pose& world_from_camera) const {
    camera.world_from_camera = world_from_camera;
    camera.near_z = scene_.setup().camera.near_z;
    return camera;
  }

  /// Judges the sub-frame, if there was one, and a frame of each other kind at the same pose.
  void judge(std::size_t photo_index, const Image& photo, const Camera& camera) {
    for (Row& row : rows_) {
      if (&row == &sub_) continue;
      FrameRequest request;  // without a forecast the paper's frame is a key frame
      request.camera = with_pose(camera, images_[photo_index].world_from_camera);
      FrameView frame;
      render_or_throw(*row.view, request, frame);
      row.picture = copy_image(frame);
    }
    std::array<ImageQuality, 5> quality;
    pool_.parallel_for(rows_.size(), [&](std::size_t i) {
      if (!rows_[i].picture.rgb.empty()) quality[i] = compare_images(rows_[i].picture, photo);
    });
    JudgedPhoto& judged =
        scene_.photos.emplace_back(JudgedPhoto{images_[photo_index].name, photo.size_px, {}});
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (rows_[i].picture.rgb.empty()) continue;
      rows_[i].tally.add(quality[i], photo_index);
      judged.rows[rows_[i].name] = {quality[i].psnr(), quality[i].ssim};
      rows_[i].picture = {};
    }
  }

  PaperCase& scene_;
  std::filesystem::path folder_;
  std::vector<ListedCamera> images_;
  ThreadPool& pool_;
  std::array<Row, 5> rows_ = {{{"3DGS", variants::vanilla},
                               {"Exact", variants::exact},
                               {"Ours", variants::ours},
                               {"Paper-key", variants::paper},
                               {"Paper-sub", variants::paper}}};
  Row& sub_ = rows_.back();
};

PaperTable quality_by_exact(PaperCase& scene) {
  QualityTally vanilla, key, sub, ours;
  const auto judge_variant = [&](const Variant& variant, const auto& take) {
    scene.for_each_trace(
        fmt::format("quality of {}", variant.name), [&](std::size_t, const ProgressReport& report) {
          take(judge(scene.setup(), scene.settings(variant), scene.options().every, report));
        });
  };
  judge_variant(variants::vanilla, [&](const QualityReport& report) { vanilla.add(report.key); });
  judge_variant(variants::paper, [&](const QualityReport& report) {
    key.add(report.key);
    sub.add(report.sub);
  });
  judge_variant(variants::ours, [&](const QualityReport& report) { ours.add(report.key); });
  return {
      .columns = quality_columns(scene.label()),
      .rows = {quality_row("3DGS", vanilla), quality_row("Paper-key", key),
               quality_row("Paper-sub", sub), quality_row("Ours", ours)},
      .notes = {fmt::format("Against the exact pipeline at the same poses, one frame in {}. "
                            "PSNR (dB) of the mean squared error over the frames; ∞: identical.",
                            scene.options().every)}};
}

}  // namespace

PaperTable quality_table(PaperCase& scene) {
  if (scene.images().empty()) return quality_by_exact(scene);
  PhotoJudge judge(scene);
  judge.run();
  return judge.table();
}

}  // namespace catgs
