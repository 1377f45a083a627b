#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "render_core/frame/renderer.h"
#include "server/encode/encoder.h"
#include "server/pipeline/frame_ticket.h"
#include "server/schedule/stream_encoders.h"

namespace catgs {

/// The settings of one client's stream.
struct StreamSettings {
  std::shared_ptr<Renderer> renderer;  // the shown scene's
  EncoderKind encoder = EncoderKind::x264;
  EncoderSettings encoding;  // for the first frames
};

/// One client's share of a device: its View (caches, image) and its encoders. Owned by the session,
/// used by one job at a time.
struct Stream {
  StreamSettings settings;
  std::unique_ptr<View> view;
  StreamEncoders encoders;
  FrameView picture;                             // borrowed from `view`: the last one rendered
  std::shared_ptr<const PackedDepths> depths{};  // of that picture; null: none
};

/// Why a stream could not be opened or a frame not made, by what the caller can do about it.
enum class Fault {
  none,
  encoder_unavailable,  // cannot be opened: another encoder may work
  encoder_failed,       // was closed: the next frame reopens it
  device_failed,        // the View was destroyed: the stream must be reopened
  other,                // for example lack of memory: the next frame may succeed
};

struct StreamOpened {
  bool ok = false;
  std::string message;  // the reason of a failure, for people
  Codec codec = Codec::h264;
  std::string codec_string;
  std::string encoder_name;
  std::optional<int> device{};  // see View::device()
  Fault fault = Fault::none;
};

/// A frame that a visit orders.
struct FrameOrder {
  FrameTicket ticket;  // refined: nothing is rendered
  FrameRequest request;
  EncoderSettings encoding;             // changes require `force_idr`
  int bitrate_kbps = min_bitrate_kbps;  // for now
  int real_fps = 1;                     // the rate that the session reaches; divides the bitrate
  bool force_idr = false;
};

struct FrameJob : FrameOrder {
  std::shared_ptr<Stream> stream;
};

struct FrameResult {
  bool ok = false;
  std::string message;  // stage and cause of a failure
  OutgoingFrame frame;
  FrameStats stats;
  std::string codec_string;  // of the encoder
  bool sharp = false;        // see EncodedFrame
  Fault fault = Fault::none;
};

/// Renders and encodes frames: on the CPU's thread pool, or on GPUs with a few render threads and a
/// pool of encoders. `done` is called once per call, on a thread of the executor. Until then the
/// stream belongs to the executor, which drops its reference afterwards.
class FrameExecutor {
 public:
  virtual ~FrameExecutor() = default;
  FrameExecutor() = default;
  FrameExecutor(const FrameExecutor&) = delete;
  FrameExecutor& operator=(const FrameExecutor&) = delete;

  /// The number of frames that should be under way at the same time.
  [[nodiscard]] virtual int slots() const = 0;
  /// Makes the stream's view and encoder for `settings`. Parts that still fit are kept.
  virtual void open(std::shared_ptr<Stream> stream, StreamSettings settings,
                    std::function<void(StreamOpened)> done) = 0;
  virtual void submit(FrameJob job, std::function<void(FrameResult)> done) = 0;
  /// Ends the stream on a thread of the executor, because freeing device memory waits for the
  /// device and would block other sessions. No job may hold the stream.
  virtual void close(std::shared_ptr<Stream> stream) = 0;
};

}  // namespace catgs
