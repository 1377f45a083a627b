#include "render_core/scene/formats/colmap.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <span>
#include <sstream>
#include <string_view>

#include <fmt/ranges.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"

namespace catgs {
namespace {

constexpr std::uint64_t max_file_bytes = std::uint64_t{8} << 30;
constexpr std::size_t max_name_bytes = 4096;
constexpr int max_side_px = 1 << 20;
using Lenses = std::map<std::uint32_t, Lens>;

constexpr std::size_t max_parameters = 16;

/// COLMAP's camera models by its numbers and names.
struct Model {
  int id;
  std::string_view name;
  std::size_t focal_lengths;  // the first parameters: f or fx, fy; then come cx, cy
  std::size_t parameters;     // more than these: distortion
  [[nodiscard]] bool pinhole() const { return id < 2; }
};
constexpr std::array<Model, 17> models = {{{0, "SIMPLE_PINHOLE", 1, 3},
                                           {1, "PINHOLE", 2, 4},
                                           {2, "SIMPLE_RADIAL", 1, 4},
                                           {3, "RADIAL", 1, 5},
                                           {4, "OPENCV", 2, 8},
                                           {5, "OPENCV_FISHEYE", 2, 8},
                                           {6, "FULL_OPENCV", 2, 12},
                                           {7, "FOV", 2, 5},
                                           {8, "SIMPLE_RADIAL_FISHEYE", 1, 4},
                                           {9, "RADIAL_FISHEYE", 1, 5},
                                           {10, "THIN_PRISM_FISHEYE", 2, 12},
                                           {11, "RAD_TAN_THIN_PRISM_FISHEYE", 2, 16},
                                           {12, "SIMPLE_DIVISION", 1, 4},
                                           {13, "DIVISION", 2, 5},
                                           {14, "SIMPLE_FISHEYE", 1, 3},
                                           {15, "FISHEYE", 2, 4},
                                           {16, "EUCM", 2, 6}}};

/// The model that is found by `key`. Throws InputError where it is unknown or refused.
template <class Key>
const Model& model_of(const std::string& file, const std::string& where, const Key& key,
                      Key Model::*member, Distortion distortion) {
  const auto model = std::ranges::find(models, key, member);
  if (model == models.end())
    throw InputError(file, where, fmt::format("unknown camera model {}", key),
                     "the models of COLMAP up to EUCM are known; panoramas have no lens");
  if (distortion == Distortion::refused && !model->pinhole())
    throw InputError(file, where, fmt::format("model {} is not a pinhole camera", model->name),
                     "colmap image_undistorter makes pinhole pictures");
  return *model;
}

Lens make_lens(const std::string& file, const std::string& where, std::uint64_t width,
               std::uint64_t height, const Model& model, std::span<const double> parameters) {
  const bool sized = width > 0 && height > 0 && width <= max_side_px && height <= max_side_px;
  const std::span<const double> focal = parameters.first(model.focal_lengths);
  const auto rest = parameters.subspan(model.focal_lengths);
  if (!sized ||
      !std::ranges::all_of(focal, [](double f) { return static_cast<float>(f) > 0.0f; }) ||
      !std::ranges::all_of(parameters,
                           [](double p) { return std::isfinite(static_cast<float>(p)); })) {
    throw InputError(file, where, "has no usable size, focal length or principal point");
  }
  const glm::dvec2 size_px(width, height);
  Lens lens{glm::ivec2(size_px), 0.5 * size_px / glm::dvec2(focal.front(), focal.back()),
            glm::dvec2(rest[0], rest[1]) / size_px, ""};
  // Those that COLMAP numbers up to FULL_OPENCV are pinholes where their numbers are 0.
  const auto bends = rest.subspan(2);
  if (model.id == 5 || model.id > 6 || std::ranges::any_of(bends, [](double k) { return k != 0; }))
    lens.distortion = fmt::format("{} {:g}", model.name, fmt::join(bends, ", "));
  return lens;
}

/// COLMAP stores camera_from_world: rotation w, x, y, z and translation.
ListedCamera make_image(const std::string& file, const std::string& where, std::string name,
                        const std::array<double, 7>& pose, const Lenses& lenses,
                        std::uint32_t camera_id, const glm::dvec3& origin) {
  const auto lens = lenses.find(camera_id);
  if (lens == lenses.end()) {
    throw InputError(file, where, fmt::format("there is no camera {}", camera_id));
  }
  const glm::dquat rotation(pose[0], pose[1], pose[2], pose[3]);
  const double norm = glm::length(rotation);
  const bool turns = norm > 1e-6 && norm < 1e6;  // squares of larger numbers are infinite
  const auto is_position = [](double p) { return std::abs(p) <= max_coordinate; };
  if (!turns || !std::all_of(pose.begin() + 4, pose.end(), is_position)) {
    throw InputError(file, where, "its pose is not a rotation and a translation");
  }
  const glm::dquat world_from_camera = glm::conjugate(rotation / norm);
  return {std::move(name),
          {glm::vec3(-(world_from_camera * glm::dvec3(pose[4], pose[5], pose[6])) - origin),
           glm::quat(world_from_camera)},
          lens->second};
}

/// Reads values one behind the other; the source throws where the file ends.
class BinaryReader {
 public:
  explicit BinaryReader(const std::filesystem::path& path) : file_(path) {}

  template <class T>
  T next() {
    std::array<std::byte, sizeof(T)> bytes;
    file_.read(offset_, bytes);
    offset_ += bytes.size();
    return load_as<T>(bytes.data());
  }
  std::string next_name() {
    std::string name;
    for (char c = next<char>(); c != '\0'; c = next<char>()) {
      if (name.size() == max_name_bytes) throw InputError(file_.name(), where(), "endless name");
      name += c;
    }
    return name;
  }
  /// Skips `count` records. The next read notices if that leads beyond the end.
  void skip(std::uint64_t count, std::uint64_t record_bytes) {
    if (count > (file_.size() - offset_) / record_bytes) {
      throw InputError(file_.name(), where(), fmt::format("{} points do not fit the file", count));
    }
    offset_ += count * record_bytes;
  }
  [[nodiscard]] std::string where() const { return fmt::format("byte {}", offset_); }
  [[nodiscard]] const std::string& name() const { return file_.name(); }

 private:
  FileSource file_;
  std::uint64_t offset_ = 0;
};

Lenses read_binary_cameras(const std::filesystem::path& path, Distortion distortion) {
  BinaryReader file(path);
  Lenses cameras;
  const auto count = file.next<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = file.where();
    const auto id = file.next<std::uint32_t>();
    const auto model_id = file.next<std::int32_t>();
    const auto width = file.next<std::uint64_t>(), height = file.next<std::uint64_t>();
    const Model& model = model_of(file.name(), where, model_id, &Model::id, distortion);
    std::array<double, max_parameters> parameters{};
    const auto used = std::span(parameters).first(model.parameters);
    for (double& parameter : used) parameter = file.next<double>();
    cameras[id] = make_lens(file.name(), where, width, height, model, used);
  }
  return cameras;
}

std::vector<ListedCamera> read_binary_images(const std::filesystem::path& path,
                                             const Lenses& cameras, const glm::dvec3& origin) {
  constexpr std::uint64_t point_bytes = 24;  // x, y and the number of a 3D point
  BinaryReader file(path);
  std::vector<ListedCamera> images;
  const auto count = file.next<std::uint64_t>();
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::string where = file.where();
    (void)file.next<std::uint32_t>();  // its number
    std::array<double, 7> pose;
    for (double& value : pose) value = file.next<double>();
    const auto camera_id = file.next<std::uint32_t>();
    images.push_back(
        make_image(file.name(), where, file.next_name(), pose, cameras, camera_id, origin));
    file.skip(file.next<std::uint64_t>(), point_bytes);
  }
  return images;
}

/// The lines of a text file, without comments, with their numbers.
struct Line {
  std::size_t number;
  std::string text;
};
std::vector<Line> read_lines(const std::filesystem::path& path) {
  const FileSource file(path);
  const std::vector<std::byte> bytes = file.read_all(max_file_bytes);
  std::istringstream stream(std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  std::vector<Line> lines;
  std::string text;
  for (std::size_t number = 1; std::getline(stream, text); ++number) {
    text.erase(text.find_last_not_of(" \t\r") + 1);
    if (!text.starts_with('#')) lines.push_back({number, text});
  }
  return lines;
}

std::string where_of(const Line& line) { return fmt::format("line {}", line.number); }

Lenses read_text_cameras(const std::filesystem::path& path, Distortion distortion) {
  Lenses cameras;
  for (const Line& line : read_lines(path)) {
    if (line.text.empty()) continue;
    std::istringstream fields(line.text);
    std::uint32_t id = 0;
    std::string model_name;
    std::uint64_t width = 0, height = 0;
    fields >> id >> model_name >> width >> height;
    const auto need = [&] {
      if (!fields)
        throw InputError(path.string(), where_of(line), "is not a camera",
                         "CAMERA_ID MODEL WIDTH HEIGHT PARAMS");
    };
    need();
    const Model model = model_of(path.string(), where_of(line), std::string_view(model_name),
                                 &Model::name, distortion);
    std::array<double, max_parameters> parameters{};
    const auto used = std::span(parameters).first(model.parameters);
    for (double& parameter : used) fields >> parameter;
    need();
    cameras[id] = make_lens(path.string(), where_of(line), width, height, model, used);
  }
  return cameras;
}

/// Whether the line has numbers in threes. An image has a name, and ten words.
bool lists_points(std::string_view text) {
  constexpr std::string_view blank = " \t";
  if (text.find_first_not_of("0123456789+-.eE \t") != std::string_view::npos) return false;
  std::size_t words = 0;
  for (std::size_t at = 0; (at = text.find_first_not_of(blank, at)) != std::string_view::npos;
       ++words)
    at = std::min(text.find_first_of(blank, at), text.size());
  return words % 3 == 0;
}

std::vector<ListedCamera> read_text_images(const std::filesystem::path& path, const Lenses& cameras,
                                           const glm::dvec3& origin) {
  const std::vector<Line> lines = read_lines(path);
  std::vector<ListedCamera> images;
  // A line of points, which may be none, is behind each image; further empty lines may be anywhere.
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines[i].text.empty()) continue;
    std::istringstream fields(lines[i].text);
    std::uint32_t id = 0, camera_id = 0;
    std::array<double, 7> pose{};
    fields >> id;
    for (double& value : pose) fields >> value;
    std::string name;
    fields >> camera_id >> std::ws;
    if (!std::getline(fields, name) || name.empty()) {
      throw InputError(path.string(), where_of(lines[i]), "is not an image",
                       "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points");
    }
    images.push_back(make_image(path.string(), where_of(lines[i]), std::move(name), pose, cameras,
                                camera_id, origin));
    while (i + 1 < lines.size() && lines[i + 1].text.empty()) ++i;
    if (i + 1 < lines.size() && lists_points(lines[i + 1].text)) ++i;
  }
  return images;
}

}  // namespace

std::vector<ListedCamera> read_colmap(const std::filesystem::path& folder, Distortion distortion,
                                      const glm::dvec3& origin) {
  std::vector<ListedCamera> images;
  bool found = false;
  for (const auto& model : {folder / "sparse" / "0", folder / "sparse", folder}) {
    std::error_code error;
    if (std::filesystem::exists(model / "images.bin", error)) {
      images = read_binary_images(model / "images.bin",
                                  read_binary_cameras(model / "cameras.bin", distortion), origin);
      found = true;
    } else if (std::filesystem::exists(model / "images.txt", error)) {
      images = read_text_images(model / "images.txt",
                                read_text_cameras(model / "cameras.txt", distortion), origin);
      found = true;
    }
    if (found) break;
  }
  if (!found) {
    throw InputError(folder.string(), "", "has no COLMAP reconstruction",
                     "sparse/0 with images.bin and cameras.bin, or the same as .txt");
  }
  if (images.empty()) throw InputError(folder.string(), "", "its reconstruction has no images");
  std::ranges::sort(images, {}, &ListedCamera::name);
  return images;
}

}  // namespace catgs
