#pragma once

#include <string>
#include <vector>

#include <prometheus/metric_family.h>

#include "render_core/scene/tree/page_figures.h"

namespace catgs {

/// The pages of a scene on one device.
struct ScenePages {
  std::string scene;
  PageFigures figures;
};

/// Returns catgs_scene_pages, catgs_scene_pages_loaded_total and the figures of the pools. The
/// series of a scene go with it.
std::vector<prometheus::MetricFamily> page_metrics(const std::vector<ScenePages>& all);

}  // namespace catgs
