#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "render_core/renderer.h"
#include "render_core/scene/analysis/surface_points.h"
#include "server/net/messages.h"
#include "server/scenes/tours.h"

namespace catgs {

/// A scene as sessions see it: one copy, shared by all.
struct SceneEntry {
  SceneFacts facts;
  std::string name{};  // of its file, for people
  std::shared_ptr<Renderer> renderer;
  bool in_pages = false;      // a tree: its frames have a detail
  std::string renderer_text;  // description and reason, for people
  std::shared_ptr<const SurfacePoints> surface{};
  std::filesystem::path sidecar{};  // where it is or would be; empty: nowhere
  std::string sidecar_tag{};        // of what it says; empty: it is not there
  ToursAnswers tours{};
  std::shared_ptr<const std::string> poster{};  // a JPEG file; null: none

  [[nodiscard]] Picked seen_along(const Pick& ray) const {
    return {ray.id, surface ? surface->distance_along(ray.origin, ray.direction) : std::nullopt};
  }
};

}  // namespace catgs
