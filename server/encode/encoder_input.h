#pragma once

#include <string>
#include <string_view>

#include "server/encode/encoder.h"

namespace catgs {

/// Throws InputError that names `encoder`, the setting and its bounds if a setting is out of
/// bounds.
void check_settings(std::string_view encoder, const EncoderSettings& settings);

/// Returns why an encoder of this size cannot take the frame; empty: it can.
std::string input_fault(const FrameView& frame, glm::ivec2 size_px);

}  // namespace catgs
