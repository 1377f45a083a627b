// The table scaling: growth of times and memory with the scene, in the same view of scenes of
// several sizes.
#include "render_core/metrics/summary.h"
#include "render_core/tools/paper/paper_tables.h"

namespace catgs {
namespace {

Number mean_ms(const Measurement& run, FrameKind kind) {
  const Summary times = summarize(run.frame_ms(kind));
  return {times.count > 0 ? times.mean : Number::nothing, 3};
}

}  // namespace

PaperTable scaling_table(PaperCase& scene) {
  const Measurement exact = pooled(scene.runs(variants::exact));
  const Measurement paper = pooled(scene.runs(variants::paper));
  const Measurement ours = pooled(scene.runs(variants::ours));
  const auto gaussians = static_cast<double>(scene.setup().gaussians());
  const auto scene_bytes = static_cast<double>(scene.setup().made.renderer->scene_bytes());
  const auto stage = [&](Stage which, FrameKind kind) {
    return Number{paper.frame_ms(kind).empty() ? Number::nothing : paper.mean_stage_ms(which, kind),
                  3};
  };
  return {.corner = "Means over the frames",
          .columns = {scene.label()},
          .rows = {{"Gaussians (10³)", {{1e-3 * gaussians, 0}}},
                   {"In view (10³)", {{1e-3 * exact.list_length().visible_mean}}},
                   {"List length (10³)", {{1e-3 * exact.list_length().mean}}},
                   {"Exact ms", {mean_ms(exact, FrameKind::key)}},
                   {"Key frame ms", {mean_ms(paper, FrameKind::key)}},
                   {"Sub-frame ms", {mean_ms(paper, FrameKind::sub)}},
                   {"Key frame project ms", {stage(Stage::project, FrameKind::key)}},
                   {"Sub-frame project ms", {stage(Stage::project, FrameKind::sub)}},
                   {"Ours ms", {mean_ms(ours, FrameKind::key)}},
                   {"Average FPS", {{ours.fps()}}},
                   {"Scene MB", {{1e-6 * scene_bytes}}},
                   {"Scene bytes per Gaussian", {{scene_bytes / gaussians}}},
                   {"View MB", {{1e-6 * static_cast<double>(ours.view_bytes)}}}},
          .notes = {"The scenes are to be seen from the same poses. In view: Gaussians that pass "
                    "culling. View: caches, lists and picture of one client."}};
}

}  // namespace catgs
