#pragma once

#include <optional>

#include <glm/vec2.hpp>

#include "server/base/clock.h"
#include "server/encode/encoder.h"
#include "server/flow/flow_control.h"
#include "server/net/messages.h"
#include "server/visit/encoder_effort.h"
#include "server/visit/visit_policy.h"

namespace catgs {

/// Limits a client's requests to the policy, for a moving camera.
FlowRequest request_within(const VisitPolicy& policy, const Settings& settings,
                           glm::ivec2 viewport_px);
/// The size of a still: the client's request within the policy.
glm::ivec2 still_size_within(const VisitPolicy& policy, const Settings& settings,
                             glm::ivec2 viewport_px);

/// Decides how a visit's pictures are encoded. The inputs are the client's requests, the policy,
/// the ladder's rung for link and decoder, and the pixels and effort that the server grants. Not
/// thread-safe.
class PicturePlan {
 public:
  PicturePlan(const VisitPolicy& policy, FlowControl& flow) : policy_(policy), flow_(flow) {}

  void begin(const Hello& hello, const EncoderEffort& effort, double pixel_share);
  /// Takes effect no more often than the policy allows, so that alternating settings open few
  /// encoders.
  void request(const Settings& settings, TimePoint now);
  /// Call it at least four times a second.
  void on_tick(TimePoint now);
  /// The encoder uses this effort from the next IDR on.
  void use_effort(const EncoderEffort& effort);
  /// Limits pictures of a moving camera to this share of the requested pixels, from the next one
  /// on.
  void use_pixel_share(double share);
  /// Allows stills larger than pictures in motion. They are allowed until one has failed.
  void allow_larger_stills(bool allowed) { larger_stills_ = allowed; }

  [[nodiscard]] const EncoderSettings& moving() const { return moving_; }
  [[nodiscard]] EncoderSettings still() const;
  [[nodiscard]] glm::ivec2 still_size_px() const {
    return larger_stills_ ? still_size_px_ : moving_.size_px;
  }
  /// Whether frames bring a depth grid.
  [[nodiscard]] bool depths() const { return settings_.depths; }
  /// The eyes that pictures of these sizes show; nothing: one.
  [[nodiscard]] const std::optional<Stereo>& stereo() const { return stereo_; }
  [[nodiscard]] const EncoderEffort& effort() const { return effort_; }
  [[nodiscard]] double pixel_share() const { return pixel_share_; }

 private:
  void follow_settings(TimePoint now);
  /// Applies all requests and limits to the next frame.
  void update();

  const VisitPolicy& policy_;
  FlowControl& flow_;
  glm::ivec2 viewport_px_{0};
  Settings settings_;
  bool settings_wait_ = false;
  std::optional<TimePoint> settings_followed_;
  EncoderEffort effort_;
  double pixel_share_ = 1.0;
  EncoderSettings moving_;
  glm::ivec2 still_size_px_{0};
  std::optional<Stereo> stereo_;
  bool larger_stills_ = true;
};

}  // namespace catgs
