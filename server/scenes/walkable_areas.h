#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <string>

#include <boost/asio/io_context.hpp>

#include "server/base/background.h"
#include "server/scenes/compute_walkable_area.h"
#include "server/scenes/derived_files.h"

namespace catgs {

/// Where people can walk in a scene.
struct WalkableArea {
  std::shared_ptr<const std::string> file;  // of render_core/walk; null: nowhere
  std::string etag{};
};

/// Finds the walkable areas of scenes in the background, one at a time. What is found stays in the
/// folder of the trees, if there is one. The functions run on the session thread.
class WalkableAreas {
 public:
  /// `files`: null: nothing is kept.
  WalkableAreas(const DerivedFiles* files, int threads, Background& background,
                boost::asio::io_context& io)
      : files_(files), threads_(threads), jobs_(background, io) {}

  [[nodiscard]] bool busy() const { return busy_; }
  /// Takes the author's file, or the one in the folder, or computes one. `found` is called on the
  /// session thread, with null after a failure that may pass. Must not be called while busy().
  void find(const std::string& scene_id, WalkableAreaSource source,
            std::function<void(std::shared_ptr<const WalkableArea>)> found);

  static constexpr std::size_t max_file_bytes = 8 << 20;  // served to pages

 private:
  [[nodiscard]] std::string find_now(const std::string& scene_id, const WalkableAreaSource& source,
                                     const std::stop_token& stop) const;
  [[nodiscard]] std::string kept_or_computed(const std::string& scene_id,
                                             const WalkableAreaSource& source,
                                             const std::stop_token& stop) const;

  const DerivedFiles* const files_;
  const int threads_;
  bool busy_ = false;
  Background::Jobs jobs_;
};

}  // namespace catgs
