#pragma once

#include <chrono>
#include <cstdint>
#include <optional>

#include <glm/vec2.hpp>

#include "server/base/clock.h"
#include "server/flow/camera_track.h"
#include "server/flow/detail_ladder.h"
#include "server/flow/flow_control.h"
#include "server/flow/frame_pace.h"
#include "server/flow/idr_policy.h"
#include "server/flow/rest.h"
#include "server/net/messages.h"
#include "server/schedule/frame_executor.h"
#include "server/schedule/next_frame_cost.h"
#include "server/schedule/scheduler.h"
#include "server/visit/visit_policy.h"

namespace catgs {

/// Decides when a visit's next frame is due, what it shows and what becomes of the result.
/// Rendering is on demand: a frame is due when the newest pose shows a new picture and the client
/// has credit. When the camera rests, one more frame is drawn as the still, which is then
/// sharpened. Pure; not thread-safe.
class FrameLoop {
 public:
  FrameLoop(const VisitPolicy& policy, FlowControl& flow)
      : policy_(policy), flow_(flow), rest_(policy.still_after), detail_(policy.detail_px) {}

  /// Forgets the poses of the previous scene.
  void enter_scene(const SceneFacts& scene);
  /// True: the camera has moved.
  bool pose_arrived(const PoseSample& sample, TimePoint now);
  void follow(const PosePath& path) { track_.follow(path); }
  /// From the next picture on, until the scene changes.
  void clip(const ClipBox& box, TimePoint now);
  [[nodiscard]] const ClipBox& clip() const { return clip_; }
  /// From the next picture on; nothing: one eye. An orthographic view has one eye.
  void see_with(const std::optional<Stereo>& eyes, TimePoint now);
  /// The client's newest camera in this scene, if any.
  [[nodiscard]] const std::optional<PoseSample>& camera() const { return track_.newest(); }
  /// Continues from the pose of a resumed client, and from the tour that led it.
  void go_on_from(const Hello& hello, TimePoint now);
  /// False: the frame is not in flight.
  bool acknowledged(const Ack& ack, TimePoint now);
  /// Discards all frames that were started so far.
  void forget_started() { obsolete_frames_ = frames_started_; }

  /// The next frame, if none is under way; none: nothing to show or no credit. `still_size`: the
  /// last frame has the size of a still.
  [[nodiscard]] std::optional<FrameCandidate> next(const IdrPolicy& idr, bool still_size) const;
  /// True: a frame that starts now may be a still. Valid after the first pose, as is start().
  [[nodiscard]] bool rests(TimePoint now) const { return settled_ && now >= rest_.begins(); }
  /// Fills in the pose and the size limit of a frame. `order` already holds the encoder settings.
  void start(FrameOrder& order, TimePoint now);
  /// A frame was made and is about to be sent. False: discard it.
  bool made(const FrameResult& result, TimePoint now);
  /// The picture that is shown would look better now.
  void outdate() { settled_ = false; }
  /// A frame failed, so its picture is not on the screen.
  void failed() { shown_.reset(); }
  /// Like failed(), with nothing changed for the next frame. True: too many failed in a row.
  bool failed_again();

  /// The detail of pictures of a moving camera.
  [[nodiscard]] float detail_px() const { return detail_.detail_px(); }
  /// The real interval between frames.
  [[nodiscard]] std::chrono::microseconds interval() const {
    return std::max(flow_.frame_interval(), pace_.real_interval());
  }

 private:
  /// True: the last picture rendered shows this pose.
  [[nodiscard]] bool shows(const PoseSample& pose) const;
  /// Limits the frame's size and schedules the next refinement.
  void limit(FrameOrder& order, TimePoint now);

  const VisitPolicy& policy_;
  FlowControl& flow_;
  float near_z_ = 0.0f;
  glm::vec3 background_{0.0f};
  ClipBox clip_;
  std::optional<Stereo> eyes_;
  CameraTrack track_;
  std::optional<TimePoint> pose_received_;
  FramePace pace_;
  Rest rest_;
  NextFrameCost cost_;
  DetailLadder detail_;
  bool settled_ = true;  // the last picture has all the detail that its scene's pages can give it
  std::optional<PoseSample> shown_;  // pose of the last picture rendered
  int refinements_left_ = 0;
  std::optional<TimePoint> next_refinement_;
  int failures_ = 0;  // in a row
  std::uint64_t frames_started_ = 0;
  std::uint64_t obsolete_frames_ = 0;  // up to this id they were made for a lost connection
};

}  // namespace catgs
