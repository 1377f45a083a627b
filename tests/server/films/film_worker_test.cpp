#include "server/films/film_worker.h"

#include <cstdlib>

#include <signal.h>
#include <sys/resource.h>

#include "render_core/base/thread_pool.h"
#include "render_core/image/png.h"
#include "render_core/metrics/image_quality.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

class FilmWorker : public testing::Test {
 protected:
  FilmWorker() {
    auto cloud = std::make_shared<GaussianCloud>(random_cloud(300, 0));
    // A sky: large ones around the view, whose projection is clamped.
    for (std::size_t i = 0; i < 60; ++i) {
      cloud->mean[i] *= 12.0f;
      cloud->scale[i] = glm::vec3(9.0f, 5.0f, 2.0f);
    }
    scene.renderer = make_renderer(std::move(cloud), {.kind = RendererKind::cpu,
                                                      .pool = std::make_shared<ThreadPool>(2)})
                         .renderer;
    scene.facts.near_z = 0.2f;
    view.position = {0, 0, -6};
  }
  Image drawn(FilmKind kind, glm::ivec2 size_px) {
    calls = 0;
    double last_share = 0.0;
    ResultFile file;
    draw_film({kind, size_px, {view}, box}, take, file, [&](double share, Clock::duration) {
      EXPECT_GE(share, last_share);
      last_share = share;
      ++calls;
    });
    EXPECT_LE(last_share, 1.0);
    return read_png(file.path());
  }
  /// True if the job can be cancelled between two shares of it.
  bool ends_between(double least, double most, FilmKind kind, glm::ivec2 size_px) {
    ResultFile file;
    try {
      draw_film({kind, size_px, {view}}, take, file, [&](double done, Clock::duration) {
        if (done > least && done < most) throw std::runtime_error("cancelled");
      });
    } catch (const std::runtime_error&) {
      return true;
    }
    return false;
  }

  SceneEntry scene;
  const std::shared_ptr<SceneLeases> leases = std::make_shared<SceneLeases>();
  const FilmScene::Take take = [this] { return leased(scene, leases, 0); };
  FilmView view;
  std::optional<FilmBox> box;
  int calls = 0;
};

TEST_F(FilmWorker, APictureInPartsIsThePicture) {
  const glm::ivec2 size_px{2200, 1100};
  const auto whole_view = scene.renderer->make_view({Pipeline::exact, PixelFormat::rgb_f32});
  for (const float view_height : {0.0f, 6.0f}) {
    view.view_height = view_height;
    if (view_height > 0.0f) box = FilmBox{{0, 0, 5}, {1, 0, 0, 0}, {1, 1, 2}};
    const Image picture = drawn(FilmKind::picture, size_px);
    EXPECT_GE(calls, 6) << "after each part";
    FrameRequest request;
    request.camera =
        make_view_camera(view.pose_about({0, 0, 0}), size_px, view.fov_y_rad, view_height, 0.2f);
    FrameView frame;
    ASSERT_TRUE(whole_view->render(request, frame).ok());
    const double psnr = compare_images(copy_image(frame), picture).psnr();
    if (box) {
      EXPECT_LT(psnr, 40.0) << "the box leaves something out";
      request.camera.clip = oriented_box({0, 0, 5}, {1, 0, 0, 0}, {1, 1, 2});
      ASSERT_TRUE(whole_view->render(request, frame).ok());
    }
    EXPECT_GT(compare_images(copy_image(frame), picture).psnr(), 55.0);
  }
}

TEST_F(FilmWorker, APanoramaShowsAllAround) {
  const Image around = drawn(FilmKind::panorama, {256, 128});
  EXPECT_EQ(around.size_px, glm::ivec2(256, 128));
  EXPECT_GE(calls, 6) << "a side is one part";
}

TEST_F(FilmWorker, CancelledWhileItIsAssembledOrWritten) {
  EXPECT_TRUE(ends_between(0.851, 1.0, FilmKind::picture, {2200, 1100})) << "written";
  EXPECT_TRUE(ends_between(0.80, 0.849, FilmKind::panorama, {2048, 1024})) << "assembled";
  EXPECT_TRUE(ends_between(0.851, 1.0, FilmKind::panorama, {2048, 1024})) << "written";
}

TEST_F(FilmWorker, SceneIsLetGoWhereItIsNeededElsewhere) {
  int taken = 0;
  const auto take_again = [&] {
    ++taken;
    EXPECT_EQ(leases->held, 0) << "before it is taken again";
    return take();
  };
  ResultFile file, undisturbed;
  const FilmRequest wanted{FilmKind::picture, {2200, 1100}, {view}};
  draw_film(wanted, take_again, file, [&](double share, Clock::duration) {
    ++leases->recalls;
    if (share > 0.851) {
      EXPECT_EQ(leases->held, 0) << "while the file is written";
    }
  });
  EXPECT_EQ(taken, 3) << "each is let go after the part that follows";
  draw_film(wanted, take, undisturbed, [](double, Clock::duration) {});
  EXPECT_EQ(read_png(file.path()).rgb, read_png(undisturbed.path()).rgb);
}

TEST_F(FilmWorker, AFilmIsAnMp4AndCanBeCancelled) {
  FilmRequest wanted{FilmKind::film, {64, 48}, {view, view}};
  for (int i = 0; i < 6; ++i) {
    view.position.x += 0.1;
    wanted.views.push_back(view);
  }
  ResultFile file;
  int frames = 0;
  draw_film(wanted, take, file, [&](double, Clock::duration) { ++frames; });
  EXPECT_GE(frames, 8);
  std::array<std::byte, 8> head{};
  ASSERT_TRUE(file.read(0, head));
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(head.data()) + 4, 4), "ftyp");
  frames = 0;
  ResultFile other;
  EXPECT_THROW(draw_film(wanted, take, other,
                         [&](double, Clock::duration) {
                           if (++frames == 3) throw std::runtime_error("cancelled");
                         }),
               std::runtime_error);
  EXPECT_EQ(frames, 3);
}

TEST_F(FilmWorker, AFullFolderForResultsIsNamed) {
  const auto complaint = [&](FilmKind kind) -> std::string {
    ResultFile file;
    rlimit before{};
    ::getrlimit(RLIMIT_FSIZE, &before);
    ::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{1000, before.rlim_max};  // a disk has no room then, for this process
    ::setrlimit(RLIMIT_FSIZE, &small);
    std::string text;
    try {
      const std::vector<FilmView> views(kind == FilmKind::film ? 30 : 1, view);
      draw_film({kind, {256, 128}, views}, take, file, [](double, Clock::duration) {});
    } catch (const InputError& error) {
      text = error.what();
    }
    ::setrlimit(RLIMIT_FSIZE, &before);
    return text;
  };
  const std::string folder = "TMPDIR " + std::filesystem::temp_directory_path().string() + ": ";
  for (const FilmKind kind : {FilmKind::picture, FilmKind::panorama, FilmKind::film})
    EXPECT_THAT(complaint(kind), StartsWith(folder));
}

TEST_F(FilmWorker, AMissingFolderForResultsIsNamed) {
  const char* const before = std::getenv("TMPDIR");
  const std::string kept = before ? before : "";
  ::setenv("TMPDIR", "/absent", 1);
  EXPECT_THAT([] { ResultFile(); },
              testing::ThrowsMessage<InputError>(HasSubstr("TMPDIR /absent: ")));
  before ? ::setenv("TMPDIR", kept.c_str(), 1) : ::unsetenv("TMPDIR");
}

}  // namespace
}  // namespace catgs::test
