#include "server/visit/stream_control.h"

#include <cassert>
#include <utility>

#include "render_core/base/build_info.h"

namespace catgs {
namespace {

void describe_pictures(StreamConfig& config, glm::ivec2 size_px, const EncoderSettings& moving) {
  config.size_px = size_px;
  config.fps = moving.fps;
  config.bitrate_kbps = moving.bitrate_kbps;
}

}  // namespace

bool StreamControl::begin(Admission admission, const Hello& hello) {
  const bool goes_on = admission.scene == scene_ && admission.encoder.kind == encoder_.kind;
  encoder_ = std::move(admission.encoder);
  enter_scene(std::move(admission.scene));
  plan_.begin(hello, admission.effort, admission.pixel_share);
  idr_.begin();
  if (goes_on) describe_pictures(config_, plan_.moving().size_px, plan_.moving());
  return goes_on;
}

void StreamControl::enter_scene(std::shared_ptr<const SceneEntry> scene) {
  scene_ = std::move(scene);
  former_.reset();
  keeps_form_ = false;
  welcome_due_ = true;
}

void StreamControl::redraw(std::shared_ptr<const SceneEntry> scene) {
  if (keeps_form_) return;
  former_ = std::exchange(scene_, std::move(scene));
  open();
}

void StreamControl::open() {
  assert(scene_);
  outdated_ = !ready();
  if (outdated_) return;
  use_ = Use::opening;
  describe_pictures(config_, plan_.moving().size_px, plan_.moving());
  host_.open_stream({scene_->renderer, encoder_.kind, plan_.moving()});
}

void StreamControl::on_opened(const StreamOpened& opened) {
  assert(opening());
  use_ = Use::none;
  if (opened.fault == Fault::encoder_unavailable && change_encoder(opened.fault)) return;
  if (!opened.ok && former_) {
    scene_ = std::exchange(former_, nullptr);
    keeps_form_ = true;
    return open();
  }
  if (!opened.ok) return;
  if (outdated_) return open();
  waits_for_pages_ = std::exchange(former_, nullptr) != nullptr;
  config_.codec = opened.codec;
  config_.codec_string = opened.codec_string;
  config_.encoder = encoder_.text;
  device_ = opened.device;
  encoded_as_.reset();
  plan_.allow_larger_stills(true);
  idr_.begin();
}

bool StreamControl::change_encoder(Fault why) {
  auto other = host_.other_encoder(why);
  if (!other) return false;
  encoder_ = *std::move(other);
  open();
  return true;
}

FrameOrder StreamControl::begin_frame(bool still, TimePoint now) {
  assert(ready());
  use_ = Use::drawing;
  FrameOrder order;
  order.ticket.still = still;
  order.ticket.codec = config_.codec;
  // A still of the same size uses the encoder in motion. Its refinements continue that stream, even
  // when the settings for motion have changed.
  order.encoding = !still ? plan_.moving() : shows_still_size() ? *encoded_as_ : plan_.still();
  if (encoded_as_ != order.encoding) idr_.begin();
  encoded_as_ = order.encoding;
  described_ = plan_.moving();
  order.force_idr = idr_.take(now);
  order.request.waits_for_pages = std::exchange(waits_for_pages_, false);
  return order;
}

void StreamControl::end_frame() {
  use_ = Use::none;
  if (outdated_) open();
}

bool StreamControl::describe(const FrameResult& made) {
  if (!made.frame.ticket.idr) return false;
  StreamConfig config = config_;
  describe_pictures(config, made.frame.ticket.size_px, described_);
  config.codec_string = made.codec_string;
  return std::exchange(config_, config) != config;
}

bool StreamControl::mend(const FrameResult& failed) {
  idr_.missed();
  // NVENC that fails is replaced, whatever the frame.
  if (failed.fault == Fault::encoder_failed && change_encoder(failed.fault)) return true;
  const bool of_larger_still =
      failed.frame.ticket.still && encoded_as_ && encoded_as_->size_px != plan_.moving().size_px;
  if (of_larger_still && failed.fault != Fault::device_failed) {
    plan_.allow_larger_stills(false);  // the picture exceeds the memory or the encoder's level
    return true;
  }
  return failed.fault == Fault::encoder_unavailable && change_encoder(failed.fault);
}

ServerMessage StreamControl::introduction() {
  if (std::exchange(welcome_due_, false)) return welcome_to(*this, host_);
  return config_;
}

Welcome welcome_to(const StreamControl& stream, VisitHost& host) {
  assert(stream.scene());
  Welcome welcome;
  welcome.scene = stream.scene()->facts;
  welcome.config = stream.config();
  welcome.renderer = stream.scene()->renderer_text;
  welcome.server_version = build_version;
  host.sign(welcome);
  return welcome;
}

}  // namespace catgs
