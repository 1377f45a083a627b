#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/base/metrics.h"
#include "server/config.h"
#include "server/scenes/scene_entry.h"
#include "server/scenes/scene_folder.h"
#include "server/scenes/scene_residency.h"
#include "server/scenes/scene_source.h"

namespace catgs {

/// All scenes of the server. Those of --scene stay in memory; those of --scene-folder are loaded on
/// demand. Loading, releasing and scanning happen one after the other on a separate thread. All
/// functions run on the session thread unless marked.
class SceneLibrary final : public SceneSource {
 public:
  /// One scene in the listing for pages that offer scenes.
  struct Listing {
    std::string id;
    std::string title;
    std::uint64_t gaussians = 0;
    SceneAbout about{};
    bool loaded = false;
    std::optional<ToursAnswers> tours{};          // of a loaded one
    std::shared_ptr<const std::string> poster{};  // of one that has been loaded; a JPEG file
  };

  /// Loads the scenes of --scene, or else the first scene of the folders, so that a running server
  /// can always show one. `clock` times loads. Throws InputError.
  SceneLibrary(const ServerConfig& config, RendererOptions core, boost::asio::io_context& io,
               Metrics& metrics, std::function<TimePoint()> clock = Clock::now);
  ~SceneLibrary() override;  // waits until the current part of a scene is read

  [[nodiscard]] std::string default_scene() const override;
  [[nodiscard]] std::vector<std::string> scene_ids() const override;
  /// Any thread. Returns the id of the only scene with this name, or else the wish itself. If two
  /// paths have had the name since the start, it stands for neither, because a link by name does
  /// not tell them apart.
  [[nodiscard]] std::string resolve(std::string_view wish) const override;
  [[nodiscard]] bool has(const std::string& id) const override { return shelf_.contains(id); }
  SceneAnswer want(const std::string& id, TimePoint now) override;
  void on_tick(TimePoint now) override;

  /// Returns null if the scene is not in memory.
  [[nodiscard]] std::shared_ptr<const SceneEntry> in_memory(const std::string& id) const;
  /// Replaces the scene's entry for clients that arrive from now on. Does nothing if the scene was
  /// reloaded since `entry` was made.
  void revise(const std::string& id, std::shared_ptr<const SceneEntry> entry);

  /// The renderer's description for the default scene.
  [[nodiscard]] std::string renderer_text() const;
  /// Any thread.
  [[nodiscard]] std::shared_ptr<const std::vector<Listing>> listing() const;
  /// Any thread. Loads a scene for a moment to make its poster, once and one at a time. Does
  /// nothing while a visitor waits for a scene, or where it would not fit beside the scenes in
  /// memory.
  void want_poster(const std::string& id);

 private:
  struct Book {
    FoundScene found;                         // for scenes of --scene, only name and size are set
    std::shared_ptr<const SceneEntry> entry;  // while in memory
    std::shared_ptr<const std::string> poster{};  // stays when the entry goes
    bool poster_tried = false;                    // for this content of the file
    bool pinned = false;
    bool outdated = false;                // the file has changed since
    bool gone = false;                    // the file is gone: not offered any more
    bool told = false;                    // the log has named its path, as others share its name
    std::optional<TimePoint> retry_at{};  // after a failure

    /// True if a user besides the shelf holds the scene.
    [[nodiscard]] bool in_use() const;
  };
  struct Loaded {
    std::shared_ptr<const SceneEntry> entry;
    std::string error;
  };

  void pin(std::shared_ptr<const SceneEntry> entry);
  void open_folders();
  [[nodiscard]] SceneNeed need_of(const Book& book) const;
  [[nodiscard]] SceneResidency::InUse in_use() const;
  void start_next(TimePoint now);
  void release(const std::string& id);
  [[nodiscard]] std::shared_ptr<const SceneEntry> read(const std::string& id,
                                                       const FoundScene& found) const;
  /// Like read(), with exceptions turned into `error`.
  Loaded load(const std::string& id, const FoundScene& found) const;
  void on_loaded(const std::string& id, Loaded loaded, TimePoint started, TimePoint now);
  /// Tells the metrics which pages of trees are in memory.
  void report_pages();
  void start_scan(TimePoint now);
  void merge(std::vector<FoundScene> found);
  /// Returns the book with this id and creates it if needed.
  Book& book_of(const std::string& id);
  [[nodiscard]] std::chrono::seconds estimate(std::uint64_t bytes) const;
  [[nodiscard]] ErrorMessage refusal(SceneResidency::Wish wish, const std::string& id,
                                     const Book& book) const;
  /// Updates listing() and the metrics.
  void publish();

  const ServerConfig config_;
  RendererOptions core_;  // for later scenes; fixed once the first ones are loaded
  boost::asio::io_context& io_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  SceneFolders folders_;  // used on the loader's thread after construction
  std::map<std::string, Book> shelf_;
  std::string preferred_scene_;  // the default scene while its file exists
  SceneResidency residency_;
  double bytes_per_second_ = 100e6;     // of the last load
  std::optional<TimePoint> next_scan_;  // nothing without folders
  bool scanning_ = false;
  bool making_poster_ = false;

  mutable std::mutex published_mutex_;  // guards the next two
  std::shared_ptr<const std::vector<Listing>> published_;
  std::map<std::string, std::string, std::less<>>
      by_name_;  // name to id; empty: two scenes have had the name

  std::atomic<bool> stopping_{false};
  boost::asio::thread_pool loader_{1};
};

}  // namespace catgs
