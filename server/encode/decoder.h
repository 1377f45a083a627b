#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <glm/vec2.hpp>

#include "server/encode/encoder.h"

namespace catgs {

/// A decoded 4:2:0 picture, planes without padding: chroma planes have half the sides, rounded up.
struct DecodedPicture {
  glm::ivec2 size_px{0};
  std::array<std::vector<std::uint8_t>, 3> planes;  // Y, Cb, Cr
  bool full_range = false;                          // JPEG; false: 16…235
  bool idr = false;
};

/// A libavcodec decoder for self-tests, tests and load generators. It takes one frame and returns
/// one picture. Damage is an error and never concealed.
class Decoder {
 public:
  /// Throws InputError if libavcodec lacks the decoder.
  explicit Decoder(Codec codec);
  ~Decoder();

  /// `bytes`: one EncodedFrame.
  EncodeStatus decode(std::span<const std::byte> bytes, DecodedPicture& picture);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace catgs
