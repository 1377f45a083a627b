#pragma once

#include <string>
#include <string_view>

#include "server/encode/encoder.h"

namespace catgs {

/// Throws InputError that names `encoder`, the setting and its bounds when one is out of them.
void check_settings(std::string_view encoder, const EncoderSettings& settings);

/// Why an encoder of this size cannot take the frame; empty when it can.
std::string input_fault(const FrameView& frame, glm::ivec2 size_px);

}  // namespace catgs
