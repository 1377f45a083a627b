#include "server/scenes/poster.h"

#include <exception>
#include <stdexcept>

#include "server/base/log_event.h"
#include "server/encode/encoder.h"

namespace catgs {
namespace {

constexpr glm::ivec2 size_px = poster_size_px;
constexpr float fov_y_rad = 1.0471976f;  // as in a page's first view: 60 degrees
// MJPEG keeps a frame to bitrate / fps: 100 kB.
constexpr int fps = 10;
constexpr float detail_px = 0.5f;  // of a scene in pages
constexpr int bitrate_kbps = 8000;

std::string render(Renderer& renderer, const SceneFacts& facts) {
  const auto view = renderer.make_view({Pipeline::exact, PixelFormat::i420});
  FrameRequest request;
  request.camera =
      make_camera(facts.start_pose, size_px, focal_from_fov_y(fov_y_rad, size_px.y), facts.near_z);
  request.background = colour_of(facts.about.background_rgb);
  request.detail_px = detail_px;
  request.waits_for_pages = true;
  FrameView picture;
  const RenderStatus rendered = view->render(request, picture);
  if (!rendered.ok()) throw std::runtime_error(rendered.message);
  const auto encoder = make_encoder(EncoderKind::jpeg, {size_px, fps, bitrate_kbps});
  EncodedFrame jpeg;
  const EncodeStatus encoded = encoder->encode(picture, true, jpeg);
  if (!encoded.ok) throw std::runtime_error(encoded.message);
  return {reinterpret_cast<const char*>(jpeg.bytes.data()), jpeg.bytes.size()};
}

}  // namespace

Poster make_poster(Renderer& renderer, const SceneFacts& facts) {
  try {
    return std::make_shared<const std::string>(render(renderer, facts));
  } catch (const std::exception& error) {
    log_warning({.event = "no_poster", .scene = facts.scene_id}, "scene {}: no poster: {}",
                facts.scene_id, error.what());
    return nullptr;
  }
}

bool same_poster(const SceneFacts& one, const SceneFacts& other) {
  return one.start_pose.position == other.start_pose.position &&
         one.start_pose.orientation == other.start_pose.orientation && one.near_z == other.near_z &&
         one.about.background_rgb == other.about.background_rgb;
}

}  // namespace catgs
