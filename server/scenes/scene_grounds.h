#pragma once

#include <atomic>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/scenes/ground_of_scene.h"

namespace catgs {

/// Where people can walk in a scene.
struct SceneGround {
  std::shared_ptr<const std::string> file;  // of render_core/walk; null: nowhere
  std::string etag{};
};

/// Finds the grounds of scenes, one at a time, on few threads of low priority. What is found stays
/// in the folder of the trees, if there is one. The functions run on the session thread.
class SceneGrounds {
 public:
  /// `folder`: --cache-dir; it belongs to this process already. Empty: nothing is kept.
  SceneGrounds(std::filesystem::path folder, int threads, boost::asio::io_context& io)
      : folder_(std::move(folder)), threads_(threads), io_(io) {}
  ~SceneGrounds();  // cancels the search under way and waits for its end

  [[nodiscard]] bool busy() const { return busy_; }
  /// Takes the author's file, or the one in the folder, or computes one. `found` is called on the
  /// session thread, with null after a failure that may pass. Must not be called while busy().
  void find(const std::string& scene_id, GroundSource source,
            std::function<void(std::shared_ptr<const SceneGround>)> found);

  static constexpr std::size_t max_file_bytes = 8 << 20;  // served to pages
  static constexpr std::size_t max_kept = 256;            // in the folder
  static constexpr std::size_t max_kept_of_scene = 4;     // as authors save it again and again

 private:
  [[nodiscard]] std::string find_now(const std::string& scene_id, const GroundSource& source) const;
  [[nodiscard]] std::string kept_or_computed(const std::string& scene_id,
                                             const GroundSource& source) const;
  void keep(const std::filesystem::path& path, const std::string& bytes) const;

  const std::filesystem::path folder_;
  const int threads_;
  boost::asio::io_context& io_;
  bool busy_ = false;
  std::atomic<bool> cancelled_{false};
  boost::asio::thread_pool finder_{1};
};

}  // namespace catgs
