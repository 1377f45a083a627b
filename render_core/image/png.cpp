#include "render_core/image/png.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cerrno>
#include <csetjmp>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <system_error>

#include <fmt/format.h>
#include <png.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

/// libpng's simplified interface, freed whatever happens.
struct PngImage : png_image {
  PngImage() : png_image{} { version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(this); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;
};

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

/// A PNG of 8 bits per channel that is written row by row. libpng reports errors by a jump, so each
/// call of it is made where no destructor would be jumped over.
class PngFile {
 public:
  explicit PngFile(const std::filesystem::path& path)
      : path_(path), file_(std::fopen(path.c_str(), "wb")) {
    if (!file_) fail(std::strerror(errno));
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    if (png_) info_ = png_create_info_struct(png_);
    if (!info_) fail("out of memory");
  }
  ~PngFile() {
    png_destroy_write_struct(&png_, &info_);
    if (!file_) return;
    file_.reset();
    std::error_code error;
    if (std::filesystem::is_regular_file(path_, error)) std::filesystem::remove(path_, error);
  }
  PngFile(const PngFile&) = delete;
  PngFile& operator=(const PngFile&) = delete;

  void begin(glm::ivec2 size_px, int colour_type, const PngText& text) {
    std::string key = text.key, words = text.text;
    png_text chunk{};
    chunk.compression = PNG_TEXT_COMPRESSION_NONE;
    chunk.key = key.data();
    chunk.text = words.data();
    attempt([&] {
      png_init_io(png_, file_.get());
      png_set_IHDR(png_, info_, static_cast<png_uint_32>(size_px.x),
                   static_cast<png_uint_32>(size_px.y), 8, colour_type, PNG_INTERLACE_NONE,
                   PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
      png_set_sRGB(png_, info_, PNG_sRGB_INTENT_PERCEPTUAL);
      if (!key.empty()) png_set_text(png_, info_, &chunk, 1);
      png_write_info(png_, info_);
    });
  }
  void write_row(const std::uint8_t* row) {
    attempt([&] { png_write_row(png_, row); });
  }
  void finish() {
    attempt([&] { png_write_end(png_, nullptr); });
    if (std::fflush(file_.get()) != 0) fail(std::strerror(errno));
    file_.reset();
  }

 private:
  template <typename Call>
  void attempt(const Call& call) {
    if (!returns(png_, call)) fail(error_.data());
  }
  template <typename Call>
  static bool returns(png_structp png, const Call& call) {
    if (setjmp(png_jmpbuf(png)) != 0) return false;
    call();
    return true;
  }
  [[noreturn]] void fail(const char* why) const {
    throw InputError(path_.string(), "", why, "does the folder exist, is there room?");
  }
  [[noreturn]] static void on_error(png_structp png, png_const_charp why) {
    auto& error = static_cast<PngFile*>(png_get_error_ptr(png))->error_;
    fmt::format_to_n(error.data(), error.size() - 1, "{}", why);
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp, png_const_charp) {}

  const std::filesystem::path path_;
  std::unique_ptr<std::FILE, CloseFile> file_;  // null: the file is complete
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  std::array<char, 128> error_{};  // of libpng
};

/// `row_of(y)` is read before the next call.
template <typename RowOf>
void write_rows(const std::filesystem::path& path, glm::ivec2 size_px, int colour_type,
                const RowOf& row_of, const AfterRow& after_row, const PngText& text = {}) {
  PngFile file(path);
  file.begin(size_px, colour_type, text);
  for (int y = 0; y < size_px.y; ++y) {
    file.write_row(row_of(y));
    if (after_row) after_row();
  }
  file.finish();
}

}  // namespace

Image read_png(const std::filesystem::path& path) {
  PngImage png;
  if (png_image_begin_read_from_file(&png, path.c_str()) == 0) {
    throw InputError(path.string(), "", png.message, "a PNG picture is expected");
  }
  if (png.width > max_image_side_px || png.height > max_image_side_px) {
    throw InputError(path.string(), "size", fmt::format("{}x{} pixels", png.width, png.height),
                     fmt::format("at most {} per side", max_image_side_px));
  }
  png.format = PNG_FORMAT_RGBA;
  png.flags |= PNG_IMAGE_FLAG_16BIT_sRGB;
  std::vector<std::uint8_t> bytes(PNG_IMAGE_SIZE(png));
  if (png_image_finish_read(&png, nullptr, bytes.data(), 0, nullptr) == 0) {
    throw InputError(path.string(), "", png.message, "the file is damaged");
  }
  Image image;
  image.size_px = {static_cast<int>(png.width), static_cast<int>(png.height)};
  image.rgb.reserve(bytes.size() / 4 * 3);
  for (std::size_t i = 0; i < bytes.size(); i += 4)
    for (std::size_t c = 0; c < 3; ++c)
      image.rgb.push_back(static_cast<float>(bytes[i + c]) / 255.0f *
                          (static_cast<float>(bytes[i + 3]) / 255.0f));
  return image;
}

std::string text_in_png(const std::filesystem::path& path, std::string_view key) {
  constexpr std::size_t signature_bytes = 8, chunk_head_bytes = 8, checksum_bytes = 4;
  constexpr std::size_t most_text_bytes = 4096;
  std::ifstream file(path, std::ios::binary);
  file.seekg(signature_bytes);
  std::array<char, chunk_head_bytes> head{};
  while (file.read(head.data(), head.size())) {
    std::size_t bytes = 0;
    for (std::size_t i = 0; i < 4; ++i) bytes = bytes << 8 | static_cast<unsigned char>(head[i]);
    const std::string_view type(head.data() + 4, 4);
    if (type == "IDAT") break;
    if (type != "tEXt" || bytes > most_text_bytes) {
      file.seekg(static_cast<std::streamoff>(bytes + checksum_bytes), std::ios::cur);
      continue;
    }
    std::string content(bytes, '\0');
    if (!file.read(content.data(), static_cast<std::streamsize>(bytes))) break;
    if (content.starts_with(std::string(key) + '\0')) return content.substr(key.size() + 1);
    file.seekg(checksum_bytes, std::ios::cur);
  }
  return {};
}

void write_png(const std::filesystem::path& path, const Image& image, std::span<const float> alpha,
               const AfterRow& after_row, const PngText& text) {
  assert(alpha.empty() || alpha.size() == image.pixels());
  const auto width = static_cast<std::size_t>(image.size_px.x);
  std::vector<std::uint8_t> bytes;
  const auto row_of = [&](int y) {
    bytes.clear();
    const std::size_t first = width * static_cast<std::size_t>(y);
    for (std::size_t i = first; i < first + width; ++i) {
      // A PNG's colour is what an opaque pixel would have.
      const float share = alpha.empty() || alpha[i] <= 0.0f ? 1.0f : alpha[i];
      for (std::size_t c = 0; c < 3; ++c) bytes.push_back(byte_of(image.rgb[3 * i + c] / share));
      if (!alpha.empty()) bytes.push_back(byte_of(alpha[i]));
    }
    return bytes.data();
  };
  write_rows(path, image.size_px, alpha.empty() ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA,
             row_of, after_row, text);
}

void write_png(const std::filesystem::path& path, glm::ivec2 size_px,
               std::span<const std::uint8_t> rgb, const AfterRow& after_row) {
  const std::size_t row_bytes = 3 * static_cast<std::size_t>(size_px.x);
  assert(rgb.size() == row_bytes * static_cast<std::size_t>(size_px.y));
  write_rows(
      path, size_px, PNG_COLOR_TYPE_RGB,
      [&](int y) { return rgb.data() + row_bytes * static_cast<std::size_t>(y); }, after_row);
}

Image copy_image(const FrameView& frame) {
  if (frame.format != PixelFormat::rgb_f32 || frame.space != MemorySpace::host) {
    throw std::invalid_argument("copy_image: needs an rgb_f32 frame in host memory");
  }
  Image image;
  image.size_px = frame.size_px;
  const std::size_t row_floats = static_cast<std::size_t>(frame.size_px.x) * 3;
  image.rgb.resize(row_floats * static_cast<std::size_t>(frame.size_px.y));
  for (int y = 0; y < frame.size_px.y; ++y) {
    const auto row = static_cast<std::size_t>(y);
    std::memcpy(image.rgb.data() + row * row_floats,
                frame.planes[0].data + row * frame.planes[0].stride_bytes,
                row_floats * sizeof(float));
  }
  return image;
}

}  // namespace catgs
