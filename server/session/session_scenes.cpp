// Session's ways into a scene, which may not be in memory yet.

#include <utility>

#include "server/session/session.h"

namespace catgs {

/// A pose in the scene before means nothing in this one.
void Session::enter_scene(std::shared_ptr<const SceneEntry> scene) {
  admission_.scene = std::move(scene);
  track_ = CameraTrack(admission_.scene->facts.near_z);
  welcome_due_ = true;
}

void Session::on(const SelectScene& select, TimePoint now) {
  note_activity(now);
  if (now - selected_ < policy_.select_gap)
    awaited_scene_ = select.scene_id;
  else
    this->select(select.scene_id, now);
}

void Session::select(const std::string& scene_id, TimePoint now) {
  selected_ = now;
  auto found = host_.find_scene(scene_id);
  if (const auto* awaited = std::get_if<SceneAwaited>(&found))
    return await_scene(scene_id, *awaited, now);
  if (awaited_scene_) welcome_due_ = true;  // the page shows that it waits
  awaited_scene_.reset();
  if (const auto* error = std::get_if<ErrorMessage>(&found)) {
    say(*error, now);
    return welcome_due_ && !opening_stream_ ? say_config(now) : void();
  }
  enter_scene(std::get<std::shared_ptr<const SceneEntry>>(std::move(found)));
  request_stream();
}

void Session::ask_again(TimePoint now) {
  // A copy: greet() keeps what it is given.
  if (state_ == State::queued) greet(Hello(waiting_hello_), now);
}

void Session::await_scene(const std::string& scene_id, const SceneAwaited& awaited, TimePoint now) {
  awaited_scene_ = scene_id;
  if (now - told_of_scene_ < speak_at_least_every) return;
  told_of_scene_ = now;
  say(QueuePlace{1, awaited.estimate, true}, now);
}

void Session::ask_for_scene(TimePoint now) {
  if (state_ == State::queued)
    ask_again(now);
  else
    select(std::string(*awaited_scene_), now);
}

}  // namespace catgs
