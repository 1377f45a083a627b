// Each model of a scene at three distances: against the reference, and surfels against a renderer
// that meets them with rays.
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"
#include "tests/support/picked.h"
#include "tests/support/rendered.h"
#include "tests/support/surfels.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

constexpr glm::ivec2 size_px = {128, 96};
constexpr float focal_px = 110.0f;

std::vector<float> rendered(const GaussianCloud& cloud, const FrameRequest& request,
                            RendererKind kind) {
  const auto renderer = make_renderer(std::make_shared<const GaussianCloud>(cloud),
                                      {kind, std::make_shared<ThreadPool>(2), "auto"})
                            .renderer;
  return test::render_in(*renderer->make_view({}), request).rgb;
}

class Models : public ::testing::TestWithParam<std::tuple<SplatModel, float>> {};

TEST_P(Models, AreDrawnAsByTheReferenceAtAnyDistance) {
  const auto [model, distance] = GetParam();
  GaussianCloud cloud = test::random_cloud(2000, 1, 91);  // around (0, 0, 5)
  cloud.model = model;
  if (model == SplatModel::surfels)
    for (glm::vec3& scale : cloud.scale) scale.z = 1e-3f * std::min(scale.x, scale.y);
  FrameRequest request;
  request.camera =
      make_camera(test::look_at({0.3f, -0.2f, 5.0f - distance}, {0, 0, 5}), size_px, focal_px);
  const std::vector<float> drawn = rendered(cloud, request, RendererKind::cpu);
  EXPECT_GE(test::psnr_db(drawn, rendered(cloud, request, RendererKind::reference)), 60.0);
  if (model == SplatModel::standard) return;
  cloud.model = SplatModel::standard;
  const double as_standard = test::psnr_db(drawn, rendered(cloud, request, RendererKind::cpu));
  RecordProperty("psnr_of_the_default_model", std::to_string(as_standard));
  if (model == SplatModel::antialiased) {
    EXPECT_LT(as_standard, 40.0) << "the model changes it";
  }
}

INSTANTIATE_TEST_SUITE_P(Distances, Models,
                         ::testing::Combine(::testing::Values(SplatModel::standard,
                                                              SplatModel::antialiased,
                                                              SplatModel::surfels),
                                            ::testing::Values(4.0f, 15.0f, 60.0f)));

struct SurfelView {
  const char* name;
  glm::vec3 from, to;
  double min_psnr_db;  // measured, less 1 dB
};
void PrintTo(const SurfelView& view, std::ostream* out) { *out << view.name; }

class Surfels : public ::testing::TestWithParam<SurfelView> {};

// Our flat Gaussians are an approximation. render_core/FRAMES.md has these figures.
TEST_P(Surfels, AsFlatGaussiansAreNearThoseThatRaysMeet) {
  ThreadPool pool(1);
  const GaussianCloud cloud = test::in_cluster_order(test::surfel_room(), pool);
  FrameRequest request;
  request.camera =
      make_camera(test::look_at(GetParam().from, GetParam().to), size_px, focal_px, 0.1f);
  const double psnr = test::psnr_db(rendered(cloud, request, RendererKind::cpu),
                                    test::render_surfels(cloud, request));
  RecordProperty("psnr", std::to_string(psnr));
  EXPECT_GE(psnr, GetParam().min_psnr_db);
}

INSTANTIATE_TEST_SUITE_P(
    Views, Surfels,
    ::testing::Values(SurfelView{"wall, 2 units, face on", {0, -1, 2}, {0, -1, 4}, 43},
                      SurfelView{"wall, 6 units, face on", {0, -1, -2}, {0, -1, 4}, 31.8},
                      SurfelView{"wall, 20 units, face on", {0, -1, -16}, {0, -1, 4}, 34.2},
                      SurfelView{"floor, 2 units, 45 degrees", {0, -1.4f, -1.4f}, {0, 0, 0}, 32.2},
                      SurfelView{"floor, 6 units, 45 degrees", {0, -4.2f, -4.2f}, {0, 0, 0}, 32.6},
                      SurfelView{"floor, 20 units, 45 degrees", {0, -14, -14}, {0, 0, 0}, 32.6},
                      SurfelView{"floor, 2 units, 10 degrees", {0, -0.35f, -2}, {0, 0, 0}, 22.1},
                      SurfelView{"floor, 6 units, 10 degrees", {0, -1.05f, -6}, {0, 0, 0}, 28.2},
                      SurfelView{"floor, 20 units, 10 degrees", {0, -3.5f, -20}, {0, 0, 0}, 36.3},
                      SurfelView{"floor, 6 units, 3 degrees", {0, -0.31f, -6}, {0, 0, 0}, 28.3}));

}  // namespace
}  // namespace catgs
