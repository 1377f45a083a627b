#pragma once

#include <memory>

#include "server/encode/encoder.h"

namespace catgs {

/// Motion JPEG by libavcodec: JFIF files. Throws InputError like make_encoder, whose validation has
/// passed.
std::unique_ptr<Encoder> make_jpeg_encoder(const EncoderSettings& settings);

}  // namespace catgs
