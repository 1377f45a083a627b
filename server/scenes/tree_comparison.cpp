#include "server/scenes/tree_comparison.h"

#include <cstddef>
#include <memory>
#include <numbers>
#include <stdexcept>
#include <vector>

#include <glm/gtc/quaternion.hpp>

#include "render_core/metrics/image_quality.h"

namespace catgs {
namespace {

constexpr glm::ivec2 picture_px{480, 270};
constexpr float fov_y_rad = 1.0471976f;  // as in a page's first view: 60 degrees
constexpr int directions = 3;
constexpr glm::ivec2 part_px{30, 30}, part_step_px{90, 90};  // 15 parts of a picture

struct Picture {
  std::vector<float> rgb;
  float coarsest_px = 0.0f;  // see FrameStats
};

/// A View's pictures of a scene whose pages are there, as far as memory has room.
class Pictures {
 public:
  Pictures(Renderer& renderer, const SceneFacts& facts, float detail_px)
      : view_(renderer.make_view({Pipeline::exact, PixelFormat::rgb_f32})) {
    request_.background = colour_of(facts.about.background_rgb);
    request_.detail_px = detail_px;
    request_.waits_for_pages = true;
  }

  [[nodiscard]] Picture of(const Camera& camera) {
    constexpr int most_tries = 20;  // beside other Views
    request_.camera = camera;
    FrameView frame;
    for (int i = 0; i < most_tries && (i == 0 || !frame.stats.settled); ++i)
      if (const RenderStatus drawn = view_->render(request_, frame); !drawn.ok())
        throw std::runtime_error(drawn.message);
    Picture picture{{}, frame.stats.coarsest_px};
    const auto row_floats = static_cast<std::size_t>(3 * camera.size_px.x);
    for (int y = 0; y < camera.size_px.y; ++y) {
      const auto* row = reinterpret_cast<const float*>(
          frame.planes[0].data + frame.planes[0].stride_bytes * static_cast<std::size_t>(y));
      picture.rgb.insert(picture.rgb.end(), row, row + row_floats);
    }
    return picture;
  }

 private:
  const std::unique_ptr<View> view_;
  FrameRequest request_;
};

std::vector<Camera> cameras_of(const SceneFacts& facts) {
  std::vector<Camera> cameras;
  for (int i = 0; i < directions; ++i) {
    Pose pose = facts.start_pose;
    const auto turn = static_cast<float>(2.0 * std::numbers::pi * i / directions);
    pose.orientation = glm::angleAxis(turn, facts.up) * pose.orientation;
    cameras.push_back(
        make_camera(pose, picture_px, focal_from_fov_y(fov_y_rad, picture_px.y), facts.near_z));
  }
  return cameras;
}

/// Squared errors of both representations over the parts that count.
struct Errors {
  double tree = 0.0, levels = 0.0;
  std::size_t values = 0;

  void add(const Picture& right, const Picture& of_tree, const Picture& of_levels,
           glm::ivec2 from_px) {
    for (int y = 0; y < part_px.y; ++y)
      for (int i = 0; i < 3 * part_px.x; ++i) {
        const auto in_part = static_cast<std::size_t>(3 * part_px.x * y + i);
        const auto at =
            static_cast<std::size_t>(3 * (picture_px.x * (from_px.y + y) + from_px.x) + i);
        const double a = static_cast<double>(of_tree.rgb[at] - right.rgb[in_part]);
        const double b = static_cast<double>(of_levels.rgb[at] - right.rgb[in_part]);
        tree += a * a;
        levels += b * b;
        ++values;
      }
  }
};

}  // namespace

TreeComparison compare_tree(Renderer& tree, Renderer& levels, bool whole, const SceneFacts& facts,
                            float detail_px, const std::function<void()>& check) {
  const std::vector<Camera> cameras = cameras_of(facts);
  // One View of the tree at a time: its pages are for that View alone.
  const auto pictures_of = [&](Renderer& renderer) {
    std::vector<Picture> all;
    Pictures pictures(renderer, facts, detail_px);
    for (const Camera& camera : cameras) {
      check();
      all.push_back(pictures.of(camera));
    }
    return all;
  };
  const std::vector<Picture> of_tree = pictures_of(tree), of_levels = pictures_of(levels);
  Pictures right(whole ? levels : tree, facts, detail_px);
  Errors errors;
  for (std::size_t i = 0; i < cameras.size(); ++i)
    for (int y = part_step_px.y / 3; y < picture_px.y; y += part_step_px.y)
      for (int x = part_step_px.x / 3; x < picture_px.x; x += part_step_px.x) {
        check();
        const Picture part = right.of(cropped(cameras[i], {x, y}, part_px));
        if (part.coarsest_px == 0.0f) errors.add(part, of_tree[i], of_levels[i], {x, y});
      }
  if (errors.values == 0) return {.whole = whole, .fits = false};
  const auto count = static_cast<double>(errors.values);
  return {psnr_db(errors.tree / count), psnr_db(errors.levels / count), whole};
}

}  // namespace catgs
