#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/thread_pool.hpp>

#include "server/config.h"
#include "server/metrics.h"
#include "server/scene_folder.h"
#include "server/session/scene_residency.h"
#include "server/session/scene_source.h"
#include "server/session/session.h"

namespace catgs {

/// All scenes of the server: those of --scene, in memory for good, and those of --scene-folder,
/// loaded when somebody asks for them. Loading, releasing and looking into the folders happen on a
/// thread of their own, one after the other; everything else but listing() on the
/// session thread.
class SceneLibrary final : public SceneSource {
 public:
  /// What a page that offers scenes needs to know.
  struct Listing {
    std::string id;
    std::string title;
    std::uint64_t gaussians = 0;
    bool loaded = false;
    std::optional<ToursAnswers> tours{};          // of a loaded one
    std::shared_ptr<const std::string> poster{};  // of a loaded one; a JPEG file
  };

  /// Loads what --scene names, and where it names nothing, the first scene of the folders: a server
  /// that is up can show something. `clock` says when a load has ended. Throws InputError.
  SceneLibrary(const ServerConfig& config, RendererOptions core, boost::asio::io_context& io,
               Metrics& metrics, std::function<TimePoint()> clock = Clock::now);
  ~SceneLibrary() override;  // waits for the part of a scene that is being read

  [[nodiscard]] std::string default_scene() const override;
  [[nodiscard]] std::vector<std::string> scene_ids() const override;
  [[nodiscard]] bool has(const std::string& id) const override { return shelf_.contains(id); }
  SceneAnswer want(const std::string& id, TimePoint now) override;
  void on_tick(TimePoint now) override;

  /// Null where it is not.
  [[nodiscard]] std::shared_ptr<const SceneEntry> in_memory(const std::string& id) const;
  /// Shows the scene as `entry` says from now on, to who comes from now on; does nothing when the
  /// scene has been loaded anew since `entry` was made of it.
  void revise(const std::string& id, std::shared_ptr<const SceneEntry> entry);

  /// Of the default scene.
  [[nodiscard]] std::string renderer_text() const;
  /// Any thread.
  [[nodiscard]] std::shared_ptr<const std::vector<Listing>> listing() const;

 private:
  struct Book {
    FoundScene found;                         // of --scene-folder; of --scene: name and size alone
    std::shared_ptr<const SceneEntry> entry;  // while in memory
    bool pinned = false;
    bool outdated = false;  // the file is another one by now
    bool gone = false;      // there is no file: nobody new is offered it
    TimePoint retry_at{};   // after a failure
  };
  struct Loaded {
    std::shared_ptr<const SceneEntry> entry;
    std::string error;
  };

  void pin(std::shared_ptr<const SceneEntry> entry);
  void open_folders();
  [[nodiscard]] static bool in_use(const Book& book);
  [[nodiscard]] SceneResidency::InUse in_use() const;
  void start_next(TimePoint now);
  void release(const std::string& id);
  /// Of a scene whose file is gone and that is in nobody's hands any more, nothing stays.
  void erase(const std::string& id);
  [[nodiscard]] std::shared_ptr<const SceneEntry> read(const std::string& id,
                                                       const FoundScene& found) const;
  /// read(), with what it throws as `error`.
  Loaded load(const std::string& id, const FoundScene& found) const;
  void on_loaded(const std::string& id, Loaded loaded, TimePoint started, TimePoint now);
  void start_scan(TimePoint now);
  void merge(std::vector<FoundScene> found);
  [[nodiscard]] std::string new_id(const std::string& name) const;
  [[nodiscard]] std::chrono::seconds estimate(std::uint64_t bytes) const;
  [[nodiscard]] ErrorMessage refusal(SceneResidency::Wish wish, const std::string& id,
                                     const Book& book) const;
  /// Shows listing() and the metrics what has changed.
  void publish();

  const ServerConfig config_;
  RendererOptions core_;  // of scenes to come; settled once the first ones are in memory
  boost::asio::io_context& io_;
  Metrics& metrics_;
  const std::function<TimePoint()> clock_;
  SceneFolders folders_;  // on the loader's thread, once the constructor is through
  std::map<std::string, Book> shelf_;
  std::map<std::filesystem::path, std::string> ids_;  // of all on the shelf: a scene keeps its id
  std::string preferred_scene_;  // the default one, while there is a file of it
  SceneResidency residency_;
  double bytes_per_second_ = 100e6;  // of the last load
  TimePoint next_scan_{};
  bool scanning_ = false;

  mutable std::mutex published_mutex_;
  std::shared_ptr<const std::vector<Listing>> published_;

  std::atomic<bool> stopping_{false};
  boost::asio::thread_pool loader_{1};
};

}  // namespace catgs
