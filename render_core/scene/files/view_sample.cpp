#include "render_core/scene/files/view_sample.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/formats/detail_tree.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/transform.h"
#include "render_core/scene/tree/read_tree.h"

namespace catgs {
namespace {

/// Collects an even sample of Gaussians that come part by part.
class Sampler {
 public:
  explicit Sampler(std::uint64_t gaussians) : even_(gaussians, ViewSample::most) {
    sample_.stands_for = static_cast<float>(even_.step());
  }

  void take(const GaussianCloud& part) {
    GaussianCloud& to = sample_.cloud;
    to.model = part.model;
    for (std::size_t i = 0; i < part.size(); ++i) {
      if (!even_.contains(taken_ + i)) continue;
      to.mean.push_back(part.mean[i]);
      to.rotation.push_back(part.rotation[i]);
      to.scale.push_back(part.scale[i]);
      to.opacity.push_back(part.opacity[i]);
      to.sh.push_back(part.sh_of(i)[0]);
    }
    taken_ += part.size();
  }
  [[nodiscard]] ViewSample result() && { return std::move(sample_); }

 private:
  EvenSample even_;
  std::uint64_t taken_ = 0;
  ViewSample sample_;
};

/// The finest levels that the sample has room for, or the coarsest one.
OpenLevels open_for_sample(const SceneLocation& scene) {
  const auto files = scene.files.open();
  const auto open = [&](std::size_t budget) {
    return scene.format->open_levels(files, scene.files.index, std::nullopt, budget, max_gaussians);
  };
  try {
    return open(ViewSample::most);
  } catch (const BudgetTooSmall& error) {
    return open(error.coarsest);
  }
}

}  // namespace

ViewSample view_sample(const GaussianCloud& whole) {
  Sampler sampler(whole.size());
  sampler.take(whole);
  return std::move(sampler).result();
}

ViewSample view_sample(
    std::uint64_t gaussians,
    const std::function<void(const std::function<void(const GaussianCloud&)>& take)>& each) {
  Sampler sampler(gaussians);
  each([&](const GaussianCloud& part) { sampler.take(part); });
  return std::move(sampler).result();
}

std::optional<ViewSample> view_sample(const SceneLocation& scene, SplatModel model,
                                      const glm::dvec3& origin, const LoadContext& context) {
  if (scene.is_in_pages()) {
    TreeFile tree(std::make_unique<FileSource>(scene.files.path));
    return view_sample(read_tree(tree, outline_gaussians, context).cloud);
  }
  if (!scene.has_levels()) return std::nullopt;
  const OpenLevels levels = open_for_sample(scene);
  Sampler sampler(levels.count);
  for (std::size_t part = 0; part < levels.parts; ++part)
    sampler.take(levels.read(part, origin, context));
  ViewSample sample = std::move(sampler).result();
  sample.cloud.model = model;
  if (model == SplatModel::surfels) flatten(sample.cloud);
  sanitize(sample.cloud, context);
  return sample;
}

}  // namespace catgs
