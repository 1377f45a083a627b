#pragma once

#include <memory>
#include <optional>

#include "server/flow/idr_policy.h"
#include "server/visit/picture_plan.h"
#include "server/visit/visit_host.h"

namespace catgs {

/// Controls a visit's stream: its scene, encoder and settings, when it is reopened, when it needs
/// an IDR, and what its client knows of it. Not thread-safe.
class StreamControl {
 public:
  StreamControl(VisitHost& host, const VisitPolicy& policy, FlowControl& flow)
      : host_(host), plan_(policy, flow) {}

  /// Begins the stream of an admitted or resumed client. False: open() must follow.
  bool begin(Admission admission, const Hello& hello);
  /// Switches to another scene. open() must follow.
  void enter_scene(std::shared_ptr<const SceneEntry> scene);
  /// Continues with another form of the same scene, between two frames. The client need not know.
  /// If that form cannot be opened, the stream keeps the one that it has.
  void redraw(std::shared_ptr<const SceneEntry> scene);
  /// Opens the stream, or reopens it as soon as it is ready().
  void open();
  /// The result of open(). `opened` counts only if the stream is not opening() again afterwards.
  void on_opened(const StreamOpened& opened);

  /// Begins a frame and returns its encoder settings. Requires ready().
  FrameOrder begin_frame(bool still, TimePoint now);
  void end_frame();
  /// Call it after a successful frame. True: the client must be told of a change before this frame.
  bool describe(const FrameResult& made);
  /// Call it after a failed frame. True: the settings for the next frame have changed.
  bool mend(const FrameResult& failed);

  /// A new welcome is due, because the client shows something else at the moment.
  void owe_welcome() { welcome_due_ = true; }
  /// The next message about the stream: a welcome if one is due.
  [[nodiscard]] ServerMessage introduction();

  [[nodiscard]] bool opening() const { return use_ == Use::opening; }
  [[nodiscard]] bool ready() const { return use_ == Use::none; }
  /// The last frame has the size of a picture that stays.
  [[nodiscard]] bool shows_still_size() const {
    return encoded_as_ && encoded_as_->size_px == plan_.still_size_px();
  }
  /// Null before begin().
  [[nodiscard]] const SceneEntry* scene() const { return scene_.get(); }
  /// The device that it renders on, if devices have numbers.
  [[nodiscard]] std::optional<int> device() const { return device_; }
  [[nodiscard]] EncoderKind encoder_kind() const { return encoder_.kind; }
  /// The configuration that the client received last.
  [[nodiscard]] const StreamConfig& config() const { return config_; }
  [[nodiscard]] PicturePlan& plan() { return plan_; }
  [[nodiscard]] const PicturePlan& plan() const { return plan_; }
  [[nodiscard]] IdrPolicy& idr() { return idr_; }
  [[nodiscard]] const IdrPolicy& idr() const { return idr_; }

 private:
  /// The work of the executor on the stream.
  enum class Use { none, opening, drawing };

  bool change_encoder(Fault why);

  VisitHost& host_;
  PicturePlan plan_;
  std::shared_ptr<const SceneEntry> scene_;
  std::shared_ptr<const SceneEntry> former_;  // its form until the new one is open
  bool keeps_form_ = false;                   // a new form could not be opened
  bool waits_for_pages_ =
      false;  // the next frame is the first of a form, and no coarser than before
  EncoderChoice encoder_;
  Use use_ = Use::none;
  bool outdated_ = false;  // another stream was requested while this one was in use
  std::optional<int> device_;
  IdrPolicy idr_;
  std::optional<EncoderSettings> encoded_as_;  // settings of the last frame; none: new stream
  EncoderSettings described_;                  // settings in motion, when the last frame began
  StreamConfig config_;
  bool welcome_due_ = false;  // the scene is new to the client
};

/// The first message to a client of this stream, which is open.
[[nodiscard]] Welcome welcome_to(const StreamControl& stream, VisitHost& host);

}  // namespace catgs
