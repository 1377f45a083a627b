#include "render_core/tools/render/frame_sink.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <optional>
#include <set>
#include <string_view>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/base/printable.h"
#include "render_core/image/png.h"
#include "render_core/tools/picture_camera.h"
#include "render_core/video/video_file.h"

namespace catgs {
namespace {

/// The array as numpy.load() reads it, version 1.0 of the format.
void write_npy(const std::filesystem::path& path, glm::ivec2 size_px,
               const std::vector<float>& values) {
  std::string header = fmt::format(
      "{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}", size_px.y, size_px.x);
  constexpr std::size_t before_header = 10, alignment = 64;
  while ((before_header + header.size() + 1) % alignment != 0) header += ' ';
  header += '\n';
  const auto length = static_cast<std::uint16_t>(header.size());
  PartFile file(path);
  file.stream() << "\x93NUMPY" << '\x01' << '\x00';
  file.stream().write(reinterpret_cast<const char*>(&length), sizeof length) << header;
  file.stream().write(reinterpret_cast<const char*>(values.data()),
                      static_cast<std::streamsize>(values.size() * sizeof(float)));
  file.finish();
}

void write_picture(const std::filesystem::path& path, const FrameView& frame,
                   const FrameLayers& layers, const std::optional<PictureCamera>& camera) {
  const PngText text = camera ? PngText{camera_key, camera_text(*camera)} : PngText{};
  write_png(path, copy_image(frame), layers.alpha, {}, text);
  if (!layers.depth.empty())
    write_npy(std::filesystem::path(path).replace_extension(".npy"), frame.size_px, layers.depth);
}

std::optional<PictureCamera> told(const Camera& camera, const glm::dvec3& origin, bool tells) {
  return tells ? std::optional(PictureCamera{camera, origin}) : std::nullopt;
}

class PngSink final : public FrameSink {
 public:
  explicit PngSink(const FrameSinkSettings& settings)
      : path_(settings.path), tells_cameras_(settings.tells_cameras), origin_(settings.origin) {}

  PixelFormat format() const override { return PixelFormat::rgb_f32; }
  void write(const FrameView& frame, const FrameLayers& layers, const Camera& camera) override {
    write_picture(path_, frame, layers, told(camera, origin_, tells_cameras_));
  }
  void finish() override {}

 private:
  std::filesystem::path path_;
  bool tells_cameras_;
  glm::dvec3 origin_;
};

class PngFolderSink final : public FrameSink {
 public:
  explicit PngFolderSink(const FrameSinkSettings& settings)
      : folder_(settings.path),
        tells_cameras_(settings.tells_cameras),
        origin_(settings.origin),
        number_(settings.first_frame),
        names_(settings.names) {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) throw InputError(folder_.string(), "", error.message(), "a folder is needed");
  }

  PixelFormat format() const override { return PixelFormat::rgb_f32; }
  void write(const FrameView& frame, const FrameLayers& layers, const Camera& camera) override {
    const std::string name =
        names_.empty() ? fmt::format("frame_{:06}", number_++) : names_.at(written_++);
    write_picture(folder_ / (name + ".png"), frame, layers, told(camera, origin_, tells_cameras_));
  }
  void finish() override {}

 private:
  std::filesystem::path folder_;
  bool tells_cameras_;
  glm::dvec3 origin_;
  std::size_t number_, written_ = 0;
  std::vector<std::string> names_;
};

/// Uncompressed video. Its header has no field for the colour matrix; readers usually infer it from
/// the size. Range and chroma position are written.
class Y4mSink final : public FrameSink {
 public:
  explicit Y4mSink(const FrameSinkSettings& settings)
      : path_(settings.path), file_(settings.path, std::ios::binary) {
    file_ << fmt::format("YUV4MPEG2 W{} H{} F{}:1000 Ip A1:1 C420jpeg XCOLORRANGE=LIMITED\n",
                         settings.size_px.x, settings.size_px.y,
                         std::llround(settings.fps * 1000.0));
    check();
  }

  PixelFormat format() const override { return PixelFormat::i420; }
  void write(const FrameView& frame, const FrameLayers&, const Camera&) override {
    file_ << "FRAME\n";
    for (int plane = 0; plane < 3; ++plane) {
      const glm::ivec2 size = plane == 0 ? frame.size_px : frame.size_px / 2;
      for (int y = 0; y < size.y; ++y) {
        const std::byte* row = frame.planes[plane].data +
                               frame.planes[plane].stride_bytes * static_cast<std::size_t>(y);
        file_.write(reinterpret_cast<const char*>(row), size.x);
      }
    }
    check();
  }
  void finish() override {
    file_.close();
    check();
  }

 private:
  void check() const {
    if (!file_) throw InputError(path_.string(), "", "cannot be written", "is there room?");
  }

  std::filesystem::path path_;
  std::ofstream file_;
};

class Mp4Sink final : public FrameSink {
 public:
  explicit Mp4Sink(const FrameSinkSettings& settings)
      : file_(make_mp4_file({settings.path.string(), settings.size_px, settings.fps})) {}

  PixelFormat format() const override { return PixelFormat::i420; }
  void write(const FrameView& frame, const FrameLayers&, const Camera&) override {
    file_->write(frame);
  }
  void finish() override { file_->finish(); }

 private:
  std::unique_ptr<VideoFile> file_;
};

}  // namespace

namespace {

/// The path without the extension of a picture; that of "frame.0001" or "image.v2" is a part of it.
std::filesystem::path without_extension(std::string name) {
  std::ranges::replace(name, '\\', '/');  // of Windows
  const auto file = std::filesystem::path(name).lexically_normal();
  std::string extension = file.extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  static constexpr std::array<std::string_view, 8> of_pictures = {".png", ".jpg",  ".jpeg", ".webp",
                                                                  ".tif", ".tiff", ".exr",  ".bmp"};
  return std::ranges::find(of_pictures, extension) != of_pictures.end()
             ? std::filesystem::path(file).replace_extension()
             : file;
}

}  // namespace

PictureNames picture_names(const std::vector<std::string>& of_path) {
  PictureNames result;
  for (const bool whole : {false, true}) {
    result = {};
    std::set<std::string> different;
    for (const std::string& of_picture : of_path) {
      const auto file = without_extension(of_picture);
      std::string name = whole ? file.string() : file.filename().string();
      std::ranges::replace(name, '/', '_');
      const bool usable =
          !name.empty() && name.size() <= 200 && name.front() != '.' && printable(name) == name;
      if (usable && different.insert(name).second) {
        result.names.push_back(name);
        continue;
      }
      result = {{},
                fmt::format("\"{}\" {}", printable(of_picture.substr(0, 80)),
                            usable ? "is the name of two" : "is no name for a file")};
      break;
    }
    if (result.problem.empty()) break;
  }
  return result;
}

bool is_video(const std::filesystem::path& path) {
  return path.extension() == ".y4m" || path.extension() == ".mp4";
}

std::unique_ptr<FrameSink> make_frame_sink(const FrameSinkSettings& settings) {
  const std::string extension = settings.path.extension().string();
  if (extension == ".png") return std::make_unique<PngSink>(settings);
  if (is_video(settings.path)) {
    if (settings.layers) {
      throw InputError("--alpha, --depth", "", "a video holds colours only",
                       "give a folder or a .png file");
    }
    if (settings.size_px.x % 2 != 0 || settings.size_px.y % 2 != 0) {
      throw InputError("--size", "", "a video needs even sides");
    }
    if (extension == ".mp4") return std::make_unique<Mp4Sink>(settings);
    return std::make_unique<Y4mSink>(settings);
  }
  if (!extension.empty() && !std::filesystem::is_directory(settings.path)) {
    throw InputError(settings.path.string(), "", "unknown kind of output",
                     "a folder, or a file .png, .y4m or .mp4");
  }
  return std::make_unique<PngFolderSink>(settings);
}

}  // namespace catgs
