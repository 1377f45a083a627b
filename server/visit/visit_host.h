#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/encode/encoder_choices.h"
#include "server/net/connection.h"
#include "server/net/messages.h"
#include "server/scenes/scene_entry.h"
#include "server/scenes/scene_source.h"
#include "server/schedule/frame_executor.h"
#include "server/visit/encoder_effort.h"

namespace catgs {

/// The grant that a visit got at its admission.
struct Admission {
  std::shared_ptr<const SceneEntry> scene;
  EncoderChoice encoder;
  EncoderEffort effort{};    // of libx264
  double pixel_share = 1.0;  // granted share of the request for a moving camera
};

/// The answer to a hello.
using AdmissionAnswer = std::variant<Admission, QueuePosition, SceneAwaited, ErrorMessage>;

/// Serves a visit with the server around it. The owner of the visit implements it; tests fake it.
class VisitHost {
 public:
  virtual ~VisitHost() = default;
  virtual AdmissionAnswer admit(const Hello& hello) = 0;
  virtual SceneAnswer find_scene(const std::string& scene_id) = 0;
  /// Fills in the scenes that the client may select, the id of the session and its tokens.
  virtual void sign(Welcome& welcome) = 0;
  virtual void send(const ServerMessage& message) = 0;
  /// Returns the ids of the frames that were dropped to make room.
  virtual std::vector<std::uint64_t> send(OutgoingFrame frame) = 0;
  virtual void close(CloseCode code, std::string_view reason) = 0;
  /// Visit::on_stream_opened() gets the result.
  virtual void open_stream(StreamSettings settings) = 0;
  /// Returns a replacement for an encoder that failed or cannot be opened, or nothing.
  virtual std::optional<EncoderChoice> other_encoder(Fault why) = 0;
};

}  // namespace catgs
