#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "render_core/frame/renderer.h"
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
  bool coarse = false;        // a coarser level, as the finest one does not fit into memory
  std::string renderer_text;  // description and reason, for people
  std::shared_ptr<const SurfacePoints> surface{};
  std::filesystem::path sidecar{};  // where it is or would be; empty: nowhere
  std::string sidecar_tag{};        // of what it says; empty: it is not there
  ToursAnswers tours{};
  std::shared_ptr<const std::string> poster{};  // a JPEG file; null: none

  /// The first thing that a ray meets, of all that the box leaves in.
  [[nodiscard]] Picked seen_along(const Pick& ray, const ClipBox& clip) const {
    const RayPart part = kept_part(clip, ray.origin, ray.direction);
    // Also where the part has overflowed: its bounds are infinite or not numbers.
    if (!surface || !(part.begin < part.end)) return {ray.id, std::nullopt};
    const auto hit = surface->hit_along(ray.origin + part.begin * ray.direction, ray.direction);
    if (!hit || part.begin + hit->distance > part.end) return {ray.id, std::nullopt};
    return {ray.id, part.begin + hit->distance, hit->spread};
  }
};

/// The scene of `entry`, as its author describes it now, drawn by the renderer of `other`.
inline std::shared_ptr<SceneEntry> redrawn(const SceneEntry& entry, const SceneEntry& other) {
  auto scene = std::make_shared<SceneEntry>(entry);
  scene->facts.gaussians = other.facts.gaussians;
  scene->renderer = other.renderer;
  scene->in_pages = other.in_pages;
  scene->coarse = other.coarse;
  scene->renderer_text = other.renderer_text;
  scene->surface = other.surface;
  return scene;
}

}  // namespace catgs
