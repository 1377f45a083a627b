#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "render_core/renderer.h"
#include "server/encode/encoder.h"
#include "server/pipeline/frame_ticket.h"
#include "server/schedule/stream_encoders.h"

namespace catgs {

/// What one client's stream is made of.
struct StreamSettings {
  std::shared_ptr<Renderer> renderer;  // of the scene that is shown
  EncoderKind encoder = EncoderKind::x264;
  EncoderSettings encoding;            // of the first frames
  std::shared_ptr<const void> seat{};  // let go of once the encoders have ended
};

/// One client's share of a device: its View (caches, image) and its encoders. Owned by the session,
/// used by one job at a time.
struct Stream {
  StreamSettings settings;  // the seat in it outlives the encoders
  std::unique_ptr<View> view;
  StreamEncoders encoders;
  FrameView picture;  // borrowed from `view`: the last one rendered
};

/// Why no stream was opened or no frame made, as far as somebody can act on it.
enum class Fault {
  none,
  encoder_unavailable,  // it cannot be opened: another one may serve
  encoder_failed,       // it was ended: the next frame opens it anew
  device_failed,        // the View was ended: the stream has to be opened again
  other,                // for want of memory, for one: the next frame may succeed
};

struct StreamOpened {
  bool ok = false;
  std::string message;  // why not, for people
  Codec codec = Codec::h264;
  std::string codec_string;
  std::string encoder_name;
  std::optional<int> device{};  // see View::device()
  Fault fault = Fault::none;
};

struct FrameJob {
  std::shared_ptr<Stream> stream;
  FrameTicket ticket;  // refined: nothing is rendered
  FrameRequest request;
  EncoderSettings encoding;             // other ones than before: with `force_idr`
  int bitrate_kbps = min_bitrate_kbps;  // for now
  int real_fps = 1;                     // what the session reaches: shares the bitrate out
  bool force_idr = false;
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

/// What renders and encodes: the CPU's thread pool, or GPUs with a few render threads and a pool of
/// encoders. `done` is called once per call, on a thread of the executor. Until then the stream
/// belongs to the executor, which keeps no reference to it afterwards.
class FrameExecutor {
 public:
  virtual ~FrameExecutor() = default;
  FrameExecutor() = default;
  FrameExecutor(const FrameExecutor&) = delete;
  FrameExecutor& operator=(const FrameExecutor&) = delete;

  /// Frames that are worth having under way at the same time.
  [[nodiscard]] virtual int slots() const = 0;
  /// Makes the stream's view and encoder for `settings`, keeping what still fits.
  virtual void open(std::shared_ptr<Stream> stream, StreamSettings settings,
                    std::function<void(StreamOpened)> done) = 0;
  virtual void submit(FrameJob job, std::function<void(FrameResult)> done) = 0;
  /// Ends the stream on a thread of the executor: freeing device memory waits for the device, and
  /// the caller has other sessions to serve. Not while a job holds it.
  virtual void close(std::shared_ptr<Stream> stream) = 0;
};

}  // namespace catgs
