#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/math/camera.h"
#include "render_core/math/stereo.h"
#include "server/base/clock.h"
#include "server/encode/encoder.h"
#include "server/encode/packed_depths.h"

namespace catgs {

/// The start and end of one stage's work on a frame.
struct StageTime {
  TimePoint start;
  TimePoint end;
};

/// Identity and history of one frame, from the pose that asked for it to the socket.
struct FrameTicket {
  std::uint64_t frame_id = 0;            // 1, 2, … within the session
  std::uint64_t pose_id = 0;             // newest pose sample that the frame is rendered from
  std::int64_t pose_client_time_us = 0;  // that sample's time on the client's clock
  Pose render_pose;
  float fov_y_rad = 0.0f;
  float view_height = 0.0f;        // as in PoseSample
  std::optional<Stereo> stereo{};  // the picture shows two eyes

  Codec codec = Codec::h264;
  bool idr = false;
  bool still = false;    // drawn at rest: late on purpose, perhaps larger
  bool refined = false;  // a still that is encoded once more: nothing is rendered
  glm::ivec2 size_px{0};

  TimePoint pose_received{};
  TimePoint ready{};    // the session could have started it, had its turn come
  TimePoint started{};  // handed to the executor
  // Missing if the frame failed before the stage ended. A refined frame has no render time.
  std::optional<StageTime> render{};
  std::optional<StageTime> encode{};
};

/// An encoded frame on its way to the socket.
struct OutgoingFrame {
  FrameTicket ticket;
  std::vector<std::byte> bitstream;
  std::shared_ptr<const PackedDepths> depths{};  // of the picture; null: none

  /// What the link carries, nearly.
  [[nodiscard]] std::size_t bytes() const {
    return bitstream.size() + (depths ? depths->codes.size() : 0);
  }
};

/// A message's topic. A newer message replaces one on the same topic, except for events.
enum class Topic : std::uint8_t {
  event,
  session,
  stream,
  place,
  statistics,
  clock,
  leader,
  ping,
  participants,
  markers
};

/// A serialised message on its way to the socket.
struct OutgoingMessage {
  Topic topic = Topic::event;
  std::vector<std::byte> bytes;
};

}  // namespace catgs
