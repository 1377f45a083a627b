#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "render_core/frame/renderer.h"
#include "render_core/image/image.h"

namespace catgs {

/// Reads a PNG of up to max_image_side_px per side, any bit depth; alpha is composed over black as
/// frames are, without a transfer function. Throws InputError.
Image read_png(const std::filesystem::path& path);

/// The text that a PNG has for a key before its pixels; empty where there is none.
std::string text_in_png(const std::filesystem::path& path, std::string_view key);

/// Called after each row of a picture. May throw, to cancel.
using AfterRow = std::function<void()>;

/// A text in a PNG, of ASCII characters; without a key there is none.
struct PngText {
  std::string key{}, text{};
};

/// Writes 8 bits per channel, rounded to nearest. `alpha` has one value per pixel of a picture that
/// was drawn over black; without it the file has no alpha. Throws InputError when the file cannot
/// be written. No file is left then, nor after `after_row` has thrown.
void write_png(const std::filesystem::path& path, const Image& image,
               std::span<const float> alpha = {}, const AfterRow& after_row = {},
               const PngText& text = {});

/// Writes bytes as they are: three a pixel, row by row from the top.
void write_png(const std::filesystem::path& path, glm::ivec2 size_px,
               std::span<const std::uint8_t> rgb, const AfterRow& after_row = {});

/// Copies a finished rgb_f32 frame out of its View.
Image copy_image(const FrameView& frame);

}  // namespace catgs
