#include "server/films/film_worker.h"

#include <algorithm>
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

using namespace std::chrono_literals;

constexpr float detail_px = 0.5f;  // of a scene in pages
constexpr int part_px = 1024;
constexpr auto look_every = 20ms;  // while nothing is drawn
// Shares of the time that a picture takes, about.
constexpr double until_written = 0.85, until_assembled = 0.6;

/// Tells how far a job is, and lets go of its scene where a visitor needs the memory.
class Progress {
 public:
  Progress(FilmScene& scene, const OnDrawn& on_drawn) : scene_(scene), on_drawn_(on_drawn) {}

  /// `steps` steps lead from the present share to this one.
  void begin(double share, std::size_t steps) {
    step_ = (share - share_) / static_cast<double>(steps);
    last_ = share;
  }
  /// A part was drawn.
  void drawn() {
    advance();
    report();
  }
  /// A step was made that takes little time.
  void step() {
    advance();
    look();
  }
  /// Looks whether the job is to end, or its scene to go.
  void look() {
    if (Clock::now() - reported_ >= look_every) report();
  }

 private:
  void advance() { share_ = std::min(share_ + step_, last_); }
  void report() {
    scene_.give_way();
    on_drawn_(share_, Clock::now() - reported_);
    reported_ = Clock::now();
  }

  FilmScene& scene_;
  const OnDrawn& on_drawn_;
  double share_ = 0.0, step_ = 0.0, last_ = 0.0;
  TimePoint reported_ = Clock::now();
};

FrameRequest request_of(const SceneEntry& scene, const FilmRequest& wanted, const FilmView& view,
                        glm::ivec2 size_px) {
  FrameRequest request;
  request.camera = make_view_camera(view.pose_about(scene.facts.origin), size_px, view.fov_y_rad,
                                    view.view_height, scene.facts.near_z);
  if (const auto& box = wanted.box)
    request.camera.clip = oriented_box(glm::vec3(box->centre - scene.facts.origin),
                                       box->orientation, box->half_extent);
  request.background = colour_of(scene.facts.about.background_rgb);
  request.waits_for_pages = true;
  return request;
}

void render(FilmScene& scene, FrameRequest request, FrameView& frame) {
  request.detail_px = scene.entry().in_pages ? detail_px : 0.0f;
  const RenderStatus status = scene.view().render(request, frame);
  if (!status.ok()) throw std::runtime_error(status.message);
}

/// Draws a picture in parts. `take(x, y, rgb)` gets each pixel. `share`: of the job, afterwards.
template <typename Take>
void draw_parts(FilmScene& scene, const FrameRequest& whole, Progress& progress, double share,
                const Take& take) {
  const glm::ivec2 size_px = whole.camera.size_px;
  const glm::ivec2 parts = (size_px + part_px - 1) / part_px;
  progress.begin(share, static_cast<std::size_t>(parts.x * parts.y));
  for (int i = 0; i < parts.x * parts.y; ++i) {
    const glm::ivec2 from = glm::ivec2(i % parts.x, i / parts.x) * part_px;
    FrameRequest part = whole;
    part.camera = cropped(whole.camera, from, glm::min(glm::ivec2(part_px), size_px - from));
    FrameView frame;
    render(scene, part, frame);
    for (int y = 0; y < part.camera.size_px.y; ++y) {
      const auto* row = reinterpret_cast<const float*>(
          frame.planes[0].data + frame.planes[0].stride_bytes * static_cast<std::size_t>(y));
      for (int x = 0; x < part.camera.size_px.x; ++x)
        take(from.x + x, from.y + y, row + std::size_t{3} * static_cast<std::size_t>(x));
    }
    progress.drawn();
  }
}

void draw_picture(const FilmRequest& wanted, FilmScene& scene, ResultFile& file,
                  Progress& progress) {
  const glm::ivec2 size_px = wanted.size_px;
  const auto width = static_cast<std::size_t>(size_px.x);
  std::vector<std::uint8_t> bytes(3 * width * static_cast<std::size_t>(size_px.y));
  draw_parts(scene, request_of(scene.entry(), wanted, wanted.views.front(), size_px), progress,
             until_written, [&](int x, int y, const float* rgb) {
               std::uint8_t* const to = bytes.data() + 3 * (width * static_cast<std::size_t>(y) +
                                                            static_cast<std::size_t>(x));
               for (int c = 0; c < 3; ++c) to[c] = byte_of(rgb[c]);
             });
  scene.let_go();
  progress.begin(1.0, static_cast<std::size_t>(size_px.y));
  write_png(file.path(), size_px, bytes, [&] { progress.step(); });
}

void draw_around(const FilmRequest& wanted, FilmScene& scene, ResultFile& file,
                 Progress& progress) {
  FrameRequest request = request_of(scene.entry(), wanted, wanted.views.front(), wanted.size_px);
  request.camera.world_from_camera =
      levelled(request.camera.world_from_camera, scene.entry().facts.up);
  ThreadPool own(1);  // helpers would not be there for visitors meanwhile
  constexpr double sides = 6.0;
  const auto rows = static_cast<std::size_t>(wanted.size_px.y);
  int drawn = 0;
  const auto draw_side = [&](const FrameRequest& of_side) {
    Image side{of_side.camera.size_px, {}};
    side.rgb.resize(3 * static_cast<std::size_t>(side.size_px.x) *
                    static_cast<std::size_t>(side.size_px.y));
    draw_parts(scene, of_side, progress, until_written * (drawn + until_assembled) / sides,
               [&](int x, int y, const float* rgb) {
                 const auto at =
                     static_cast<std::size_t>(y) * static_cast<std::size_t>(side.size_px.x) +
                     static_cast<std::size_t>(x);
                 std::copy_n(rgb, 3, side.rgb.data() + 3 * at);
               });
    progress.begin(until_written * ++drawn / sides, rows);
    return side;
  };
  const Image image =
      draw_panorama(request, wanted.size_px, own, draw_side, [&] { progress.step(); });
  scene.let_go();
  progress.begin(1.0, rows);
  write_png(file.path(), image, {}, [&] { progress.step(); });
}

void draw_frames(const FilmRequest& wanted, FilmScene& scene, ResultFile& file,
                 Progress& progress) {
  const auto video =
      make_mp4_file({file.path(), wanted.size_px, film_fps, 1, [&] { progress.look(); }});
  FrameView frame;
  const std::size_t count = wanted.views.size();
  progress.begin(1.0, count);
  for (std::size_t i = 0; i < count; ++i) {
    if (!scene.has_view() || wanted.views[i] != wanted.views[i - 1])
      render(scene, request_of(scene.entry(), wanted, wanted.views[i], wanted.size_px), frame);
    video->write(frame);
    if (file.size() > most_film_bytes)
      throw NotDrawn(fmt::format("the film is larger than {} MiB", most_film_bytes >> 20));
    progress.drawn();
  }
  scene.let_go();
  video->finish();
}

void draw(const FilmRequest& wanted, const FilmScene::Take& take, ResultFile& file,
          const OnDrawn& on_drawn) {
  const bool film = wanted.kind == FilmKind::film;
  FilmScene scene(take, film ? PixelFormat::i420 : PixelFormat::rgb_f32);
  Progress progress(scene, on_drawn);
  if (film) return draw_frames(wanted, scene, file, progress);
  if (wanted.kind == FilmKind::panorama) return draw_around(wanted, scene, file, progress);
  draw_picture(wanted, scene, file, progress);
}

}  // namespace

/// The file has no name, so that its folder tells operators where there is no room.
void draw_film(const FilmRequest& wanted, const FilmScene::Take& take, ResultFile& file,
               const OnDrawn& on_drawn) {
  try {
    draw(wanted, take, file, on_drawn);
  } catch (const InputError& failure) {
    std::string why = failure.what();
    const std::string path = file.path();
    if (why.starts_with(path)) why.replace(0, path.size(), "TMPDIR " + file.folder().string());
    throw InputError("", "", why);
  }
}

}  // namespace catgs
