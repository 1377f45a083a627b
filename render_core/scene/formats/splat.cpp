#include "render_core/scene/formats/splat.h"

#include <algorithm>
#include <array>
#include <memory>
#include <ostream>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/losses.h"
#include "render_core/scene/formats/scene_format.h"

namespace catgs {

namespace {

struct SplatRow {
  std::array<float, 3> mean, scale;
  std::array<unsigned char, 4> rgba, rotation;  // rotation: w, x, y, z
};
static_assert(sizeof(SplatRow) == 32);

constexpr std::size_t block_rows = 4096;  // 128 KiB

void store(const SplatRow& row, GaussianCloud& cloud, std::size_t i) {
  const auto component = [&](std::size_t k) {
    return (static_cast<float>(row.rotation[k]) - 128.0f) / 128.0f;
  };
  const auto sh = [&](std::size_t k) {
    return sh_from_colour(static_cast<float>(row.rgba[k]) / 255.0f);
  };
  cloud.mean[i] = {row.mean[0], row.mean[1], row.mean[2]};
  cloud.scale[i] = {row.scale[0], row.scale[1], row.scale[2]};
  cloud.rotation[i] = unit(glm::quat(component(0), component(1), component(2), component(3)));
  cloud.opacity[i] = opacity_from_byte(row.rgba[3]);
  cloud.sh[i] = {sh(0), sh(1), sh(2)};
}

}  // namespace

std::uint64_t count_splat(const ByteSource& file, std::uint64_t most) {
  if (file.size() % sizeof(SplatRow) != 0)
    throw InputError(file.name(), fmt::format("byte {}", file.size()),
                     "the size of a .splat file is a multiple of 32 bytes",
                     "the file is cut off or of another format");
  const std::uint64_t count = file.size() / sizeof(SplatRow);
  require_count(file, "", count, most);
  return count;
}

GaussianCloud read_splat_rows(const ByteSource& file, const FileRows& rows,
                              const LoadContext& context) {
  GaussianCloud cloud;
  cloud.resize(rows.count, 0);
  context.for_blocks(rows.count, block_rows, [&](std::size_t begin, std::size_t end) {
    const std::vector<std::byte> bytes = read_rows(file, 0, sizeof(SplatRow), rows, begin, end);
    for (std::size_t i = begin; i < end; ++i)
      store(load_as<SplatRow>(&bytes[(i - begin) * sizeof(SplatRow)]), cloud, i);
  });
  return cloud;
}

GaussianCloud read_splat(const ByteSource& file, const LoadContext& context) {
  return read_splat_rows(file, {0, count_splat(file)}, context);
}

void write_splat(const GaussianCloud& cloud, std::ostream& to) {
  std::vector<SplatRow> rows;
  for (std::size_t begin = 0; begin < cloud.size(); begin += block_rows) {
    const std::size_t end = std::min(cloud.size(), begin + block_rows);
    rows.clear();
    for (std::size_t i = begin; i < end; ++i) {
      const auto colour = [&](int k) {
        return to_byte(255.0f * colour_from_sh(cloud.sh_of(i)[0][k]));
      };
      const auto component = [](float v) { return to_byte(128.0f * v + 128.0f); };
      const glm::quat& q = cloud.rotation[i];
      const glm::vec3 &m = cloud.mean[i], &s = cloud.scale[i];
      rows.push_back({{m.x, m.y, m.z},
                      {s.x, s.y, s.z},
                      {colour(0), colour(1), colour(2), to_byte(255.0f * cloud.opacity[i])},
                      {component(q.w), component(q.x), component(q.y), component(q.z)}});
    }
    to.write(reinterpret_cast<const char*>(rows.data()),
             static_cast<std::streamsize>(rows.size() * sizeof(SplatRow)));
  }
}

namespace {

std::optional<DecodedParts> splat_in_parts(const SceneFiles& files, std::uint64_t part_rows,
                                           std::uint64_t most, const LoadContext& context) {
  const auto file = std::make_shared<const FileSource>(files.path);
  const auto read = [=](const FileRows& rows, const glm::dvec3& origin,
                        const LoadContext& reading) {
    GaussianCloud cloud = read_splat_rows(*file, rows, reading);
    move_origin(cloud, origin);
    return cloud;
  };
  return parts_of_rows("splat", count_splat(*file, most), part_rows, read, context);
}

}  // namespace

constexpr SceneFormat splat_format = {
    .name = "splat",
    .extensions = {".splat"},
    .is_mine = [](const ByteSource&, std::string_view extension) { return extension == ".splat"; },
    .size =
        [](const SceneFiles& files) {
          return SceneSize{FileSource(files.path).size() / sizeof(SplatRow), 0};
        },
    .read = [](const SceneFiles& files, const LoadContext& context) -> DecodedScene {
      return {"splat", read_splat(FileSource(files.path), context)};
    },
    .read_parts = splat_in_parts,
    .write = [](const GaussianCloud& cloud, const glm::dvec3&, ThreadPool&,
                std::ostream& to) { write_splat(cloud, to); },
    .losses =
        [](const GaussianCloud& cloud) {
          Losses losses(cloud);
          if (cloud.sh_degree > 0) losses.add("harmonics above degree 0 are left out");
          losses.harmonics(0, 0, sh_from_colour(0.0f), sh_from_colour(1.0f),
                           "colours outside of 0…1");
          return std::move(losses).notes();
        },
};

}  // namespace catgs
