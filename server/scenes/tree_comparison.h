#pragma once

#include <functional>

#include "render_core/frame/renderer.h"
#include "server/net/messages.h"

namespace catgs {

/// How near two representations of a scene come to all of its Gaussians: PSNR over the same pixels.
struct TreeComparison {
  double tree_db = 0.0;
  double levels_db = 0.0;  // of the scene without a tree
  bool whole = false;      // that has all Gaussians
  bool fits = true;        // the tree of a part of a picture, into the pool of pages

  /// Whether the tree is to be drawn. Levels of the source are as quick as a tree, so the better
  /// one is. The whole scene is slower, so that the tree need not be its equal. Where nothing of
  /// the tree fits, levels lack less.
  [[nodiscard]] bool tree_is_good() const {
    constexpr double good_db = 35.0;
    return fits && (tree_db >= levels_db || (whole && tree_db >= good_db));
  }
};

/// Compares pictures of both from where visits begin, in three directions. `whole`: `levels` has
/// all Gaussians. Otherwise the tree itself shows what is right: it draws small parts of the
/// pictures, one by one, whose pages fit into the pool. Parts that do not fit do not count.
/// `detail_px`: of the tree. `check` is called often and may throw to cancel. Throws
/// std::runtime_error if a picture cannot be drawn.
TreeComparison compare_tree(Renderer& tree, Renderer& levels, bool whole, const SceneFacts& facts,
                            float detail_px, const std::function<void()>& check);

}  // namespace catgs
