#pragma once

#include <functional>
#include <memory>

#include "render_core/frame/renderer.h"
#include "server/scenes/scene_lease.h"

namespace catgs {

/// The scene of a film, and a View of it. Between two pictures both are let go if a visitor needs
/// their memory, and taken again when the next picture is drawn. One thread.
class FilmScene {
 public:
  /// Returns a lease, perhaps after a wait. Throws what ends the film.
  using Take = std::function<LeasedScene()>;

  /// Takes the scene for the first time.
  FilmScene(Take take, PixelFormat format)
      : take_(std::move(take)), format_(format), scene_(take_()) {}

  [[nodiscard]] const SceneEntry& entry() {
    if (!scene_.lease) scene_ = take_();
    return *scene_.entry;
  }
  /// Valid until let_go().
  View& view() {
    if (!view_) view_ = entry().renderer->make_view({Pipeline::exact, format_});
    return *view_;
  }
  /// True if what the View has drawn last is still there.
  [[nodiscard]] bool has_view() const { return view_ != nullptr; }

  void let_go() {
    view_.reset();
    scene_ = {};
  }
  /// Call it often between pictures.
  void give_way() {
    if (scene_.lease && scene_.lease->recalled()) let_go();
  }

 private:
  const Take take_;
  const PixelFormat format_;
  LeasedScene scene_;
  std::unique_ptr<View> view_;  // of scene_
};

}  // namespace catgs
