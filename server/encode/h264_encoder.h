#pragma once

#include <memory>

#include "server/encode/encoder.h"

namespace catgs {

/// libx264 on the CPU. Throws InputError like make_encoder, whose validation has passed.
std::unique_ptr<Encoder> make_x264_encoder(const EncoderSettings& settings);

/// NVENC through libavcodec, fed with host frames. Throws InputError like make_encoder.
std::unique_ptr<Encoder> make_nvenc_encoder(const EncoderSettings& settings);

}  // namespace catgs
