#include "server/films/film_artist.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/image/panorama.h"
#include "render_core/image/png.h"
#include "render_core/video/video_file.h"

namespace catgs {
namespace {

constexpr float detail_px = 0.5f;  // of a scene in pages
constexpr int part_px = 1024;

FrameRequest request_of(const SceneEntry& scene, const FilmView& view, glm::ivec2 size_px) {
  FrameRequest request;
  request.camera = make_camera(view.world_from_camera, size_px,
                               focal_from_fov_y(view.fov_y_rad, size_px.y), scene.facts.near_z);
  request.background = colour_of(scene.facts.about.background_rgb);
  request.detail_px = scene.in_pages ? detail_px : 0.0f;
  request.waits_for_pages = true;
  return request;
}

void render(View& view, const FrameRequest& request, FrameView& frame) {
  const RenderStatus status = view.render(request, frame);
  if (!status.ok()) throw std::runtime_error(status.message);
}

/// Draws pictures in parts, and tells after each one.
class Parts {
 public:
  Parts(Renderer& renderer, int pictures, const OnDrawn& on_drawn)
      : view_(renderer.make_view({Pipeline::exact, PixelFormat::rgb_f32})),
        pictures_(pictures),
        on_drawn_(on_drawn) {}

  /// `take(x, y, rgb)` gets each pixel.
  template <typename Take>
  void draw(const FrameRequest& whole, const Take& take) {
    const glm::ivec2 size_px = whole.camera.size_px;
    const glm::ivec2 parts = (size_px + part_px - 1) / part_px;
    for (int i = 0; i < parts.x * parts.y; ++i) {
      const TimePoint start = Clock::now();
      const glm::ivec2 from = glm::ivec2(i % parts.x, i / parts.x) * part_px;
      FrameRequest part = whole;
      part.camera = cropped(whole.camera, from, glm::min(glm::ivec2(part_px), size_px - from));
      FrameView frame;
      render(*view_, part, frame);
      for (int y = 0; y < part.camera.size_px.y; ++y) {
        const auto* row = reinterpret_cast<const float*>(
            frame.planes[0].data + frame.planes[0].stride_bytes * static_cast<std::size_t>(y));
        for (int x = 0; x < part.camera.size_px.x; ++x)
          take(from.x + x, from.y + y, row + std::size_t{3} * static_cast<std::size_t>(x));
      }
      const double of_picture = static_cast<double>(i + 1) / (parts.x * parts.y);
      // Writing the file takes its time, too.
      on_drawn_(0.95 * (drawn_ + of_picture) / pictures_, Clock::now() - start);
    }
    ++drawn_;
  }

 private:
  std::unique_ptr<View> view_;
  const int pictures_;
  const OnDrawn& on_drawn_;
  int drawn_ = 0;
};

std::uint8_t byte_of(float value) {
  return static_cast<std::uint8_t>(std::lround(255.0f * std::clamp(value, 0.0f, 1.0f)));
}

void draw_picture(const FilmWish& wish, const SceneEntry& scene, ResultFile& file,
                  const OnDrawn& on_drawn) {
  const glm::ivec2 size_px = wish.size_px;
  const auto width = static_cast<std::size_t>(size_px.x);
  std::vector<std::uint8_t> bytes(3 * width * static_cast<std::size_t>(size_px.y));
  Parts(*scene.renderer, 1, on_drawn)
      .draw(request_of(scene, wish.views.front(), size_px), [&](int x, int y, const float* rgb) {
        std::uint8_t* const to =
            bytes.data() + 3 * (width * static_cast<std::size_t>(y) + static_cast<std::size_t>(x));
        for (int c = 0; c < 3; ++c) to[c] = byte_of(rgb[c]);
      });
  write_png(file.path(), size_px, bytes);
}

void draw_around(const FilmWish& wish, const SceneEntry& scene, ResultFile& file,
                 const OnDrawn& on_drawn) {
  FrameRequest request = request_of(scene, wish.views.front(), wish.size_px);
  request.camera.world_from_camera = levelled(request.camera.world_from_camera, scene.facts.up);
  Parts parts(*scene.renderer, 6, on_drawn);
  ThreadPool own(1);  // helpers would not be there for visitors meanwhile
  const Image image = draw_panorama(request, wish.size_px, own, [&](const FrameRequest& of_side) {
    Image side{of_side.camera.size_px, {}};
    side.rgb.resize(3 * static_cast<std::size_t>(side.size_px.x) *
                    static_cast<std::size_t>(side.size_px.y));
    parts.draw(of_side, [&](int x, int y, const float* rgb) {
      const auto at = static_cast<std::size_t>(y) * static_cast<std::size_t>(side.size_px.x) +
                      static_cast<std::size_t>(x);
      std::copy_n(rgb, 3, side.rgb.data() + 3 * at);
    });
    return side;
  });
  write_png(file.path(), image);
}

bool same(const FilmView& a, const FilmView& b) {
  return a.world_from_camera.position == b.world_from_camera.position &&
         a.world_from_camera.orientation == b.world_from_camera.orientation &&
         a.fov_y_rad == b.fov_y_rad;
}

void draw_frames(const FilmWish& wish, const SceneEntry& scene, ResultFile& file,
                 const OnDrawn& on_drawn) {
  const auto view = scene.renderer->make_view({Pipeline::exact, PixelFormat::i420});
  const auto video = make_mp4_file({file.path(), wish.size_px, film_fps, 1});
  FrameView frame;
  const std::size_t count = wish.views.size();
  for (std::size_t i = 0; i < count; ++i) {
    const TimePoint start = Clock::now();
    if (i == 0 || !same(wish.views[i], wish.views[i - 1]))
      render(*view, request_of(scene, wish.views[i], wish.size_px), frame);
    video->write(frame);
    if (file.size() > most_film_bytes)
      throw NotDrawn(fmt::format("the film is larger than {} MiB", most_film_bytes >> 20));
    on_drawn(static_cast<double>(i + 1) / static_cast<double>(count), Clock::now() - start);
  }
  video->finish();
}

void draw(const FilmWish& wish, const SceneEntry& scene, ResultFile& file,
          const OnDrawn& on_drawn) {
  if (wish.kind == FilmKind::film) return draw_frames(wish, scene, file, on_drawn);
  if (wish.kind == FilmKind::panorama) return draw_around(wish, scene, file, on_drawn);
  draw_picture(wish, scene, file, on_drawn);
}

}  // namespace

/// The file has no name, so that its folder tells operators where there is no room.
void draw_film(const FilmWish& wish, const SceneEntry& scene, ResultFile& file,
               const OnDrawn& on_drawn) {
  try {
    draw(wish, scene, file, on_drawn);
  } catch (const InputError& failure) {
    std::string why = failure.what();
    const std::string path = file.path();
    if (why.starts_with(path)) why.replace(0, path.size(), "TMPDIR " + file.folder().string());
    throw InputError("", "", why);
  }
}

}  // namespace catgs
