#include "render_core/scene/formats/ksplat.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <glm/gtc/packing.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

namespace {

constexpr std::size_t header_bytes = 4096, section_header_bytes = 1024;
constexpr std::uint32_t default_range = 32767;  // 16 bits around the centre of a bucket
constexpr float default_sh_range = 1.5f;
constexpr std::size_t block_rows = 4096;

struct Header {
  std::uint32_t sections = 0, count = 0;
  int level = 0;  // of compression, 0…2
  float sh_min = 0.0f, sh_max = 0.0f;
};

struct Section {
  std::uint32_t count = 0, capacity = 0;  // Gaussians, and rows that there is room for
  std::uint32_t bucket_rows = 0, buckets = 0, full_buckets = 0, partial_buckets = 0;
  std::uint32_t bucket_bytes = 0, range = 0;
  float block_size = 0.0f;
  int sh_degree = 0;
  std::uint64_t offset = 0;  // of its data: lengths of partial buckets, bucket centres, rows
  std::size_t row_bytes = 0;

  [[nodiscard]] std::uint64_t centres_offset() const {
    return offset + sizeof(std::uint32_t) * std::uint64_t{partial_buckets};
  }
  [[nodiscard]] std::uint64_t rows_offset() const {
    const std::uint64_t centres = buckets;
    return centres * bucket_bytes + centres_offset();
  }
  [[nodiscard]] std::uint64_t end() const {
    const std::uint64_t rows = capacity;
    return rows * row_bytes + rows_offset();
  }
};

struct Layout {
  Header header;
  std::vector<Section> sections;  // that have Gaussians
  int sh_degree = 0;
};

[[noreturn]] void fail(const ByteSource& file, std::string_view where, std::string_view what) {
  throw InputError(file.name(), where, what, "not a .ksplat file, or a damaged one");
}

std::size_t row_bytes(int level, int sh_degree) {
  const std::size_t number = level == 0 ? 4 : 2, sh_number = level == 0 ? 4 : level == 1 ? 2 : 1;
  const auto rest = static_cast<std::size_t>(sh_coefficient_count(sh_degree) - 1);
  return 10 * number + 4 + 3 * rest * sh_number;
}

Header parse_header(const ByteSource& file) {
  std::array<std::byte, 44> bytes;
  file.read(0, bytes);
  const auto word = [&](std::size_t k) { return load_as<std::uint32_t>(&bytes[4 * k]); };
  if (word(0) % 65536 < 256 || word(0) % 256 != 0)
    fail(file, "byte 0",
         fmt::format("version {}.{} is not supported; 0.1 is", word(0) % 256, word(0) / 256 % 256));
  Header header;
  header.sections = word(1);
  header.count = word(4);
  header.level = load_as<std::uint16_t>(&bytes[20]);
  header.sh_min = load_as<float>(&bytes[36]);
  header.sh_max = load_as<float>(&bytes[40]);
  if (header.sh_min == 0.0f) header.sh_min = -default_sh_range;
  if (header.sh_max == 0.0f) header.sh_max = default_sh_range;
  if (header.level > 2)
    fail(file, "compressionLevel", fmt::format("{} is not in 0…2", header.level));
  if (file.size() < header_bytes ||
      header.sections > (file.size() - header_bytes) / section_header_bytes)
    fail(file, "maxSectionCount",
         fmt::format("{} sections do not fit into {} bytes", header.sections, file.size()));
  return header;
}

Section parse_section(const ByteSource& file, const Header& header, std::uint32_t index,
                      std::uint64_t offset) {
  std::array<std::byte, 44> bytes;
  file.read(header_bytes + std::uint64_t{section_header_bytes} * index, bytes);
  const auto word = [&](std::size_t k) { return load_as<std::uint32_t>(&bytes[4 * k]); };
  const std::string where = fmt::format("section {}", index);
  Section section;
  section.offset = offset;
  section.count = word(0);
  section.capacity = word(1);
  section.bucket_rows = word(2);
  section.buckets = word(3);
  section.block_size = load_as<float>(&bytes[16]);
  section.bucket_bytes = load_as<std::uint16_t>(&bytes[20]);
  section.range = word(6) ? word(6) : default_range;
  section.full_buckets = word(8);
  section.partial_buckets = word(9);
  section.sh_degree = load_as<std::uint16_t>(&bytes[40]);
  if (section.sh_degree > 2)
    fail(file, where, fmt::format("SH degree {} is not in 0…2", section.sh_degree));
  section.row_bytes = row_bytes(header.level, section.sh_degree);
  if (section.count > section.capacity)
    fail(file, where, fmt::format("{} Gaussians in {} rows", section.count, section.capacity));
  if (section.end() > file.size())
    fail(file, where,
         fmt::format("ends at byte {}, and the file at {}", section.end(), file.size()));
  if (header.level > 0 && section.count > 0) {
    if (section.bucket_bytes < 3 * sizeof(float))
      fail(file, where, fmt::format("{} bytes for a bucket's centre", section.bucket_bytes));
    if (std::uint64_t{section.full_buckets} + section.partial_buckets > section.buckets)
      fail(file, where, fmt::format("more buckets in use than its {}", section.buckets));
  }
  return section;
}

Layout read_layout(const ByteSource& file) {
  Layout layout;
  layout.header = parse_header(file);
  std::uint64_t offset =
      header_bytes + std::uint64_t{section_header_bytes} * layout.header.sections;
  std::uint64_t count = 0;
  for (std::uint32_t i = 0; i < layout.header.sections; ++i) {
    const Section section = parse_section(file, layout.header, i, offset);
    offset = section.end();
    if (section.count == 0) continue;
    count += section.count;
    layout.sh_degree = std::max(layout.sh_degree, section.sh_degree);
    layout.sections.push_back(section);
  }
  if (count != layout.header.count)
    fail(file, "splatCount",
         fmt::format("{}, and its sections have {}", layout.header.count, count));
  require_count(file, "splatCount", count);
  return layout;
}

/// Where each Gaussian's bucket is: full buckets first, then those of any length.
class Buckets {
 public:
  Buckets(const ByteSource& file, const Section& section) : rows_(section.bucket_rows) {
    std::vector<std::uint32_t> lengths(section.partial_buckets);
    file.read(section.offset, std::as_writable_bytes(std::span(lengths)));
    std::uint64_t end = std::uint64_t{section.full_buckets} * rows_;
    partial_begin_ = end;
    full_ = section.full_buckets;
    for (const std::uint32_t length : lengths) ends_.push_back(end += length);
    if (end < section.count)
      fail(file, "buckets", fmt::format("{} of {} Gaussians are in one", end, section.count));
    std::vector<std::byte> bytes(std::size_t{section.bucket_bytes} * section.buckets);
    file.read(section.centres_offset(), bytes);
    for (std::size_t i = 0; i < section.buckets; ++i)
      centres_.push_back(load_as<glm::vec3>(&bytes[i * section.bucket_bytes]));
  }
  /// Centre of the bucket of Gaussian `i`.
  [[nodiscard]] const glm::vec3& centre(std::size_t i) const {
    if (i < partial_begin_) return centres_[i / rows_];
    const auto bucket = std::upper_bound(ends_.begin(), ends_.end(), i) - ends_.begin();
    return centres_[full_ + static_cast<std::size_t>(bucket)];
  }

 private:
  std::uint32_t rows_;
  std::size_t full_ = 0;
  std::uint64_t partial_begin_ = 0;
  std::vector<std::uint64_t> ends_;  // of the partial buckets, as indices of Gaussians
  std::vector<glm::vec3> centres_;
};

/// The harmonics of a row: for each degree the coefficients of red, then green, then blue.
template <class Number>
void store_sh(const Number& number, int degree, glm::vec3* sh) {
  std::size_t at = 0;
  for (int l = 1; l <= degree; ++l)
    for (int channel = 0; channel < 3; ++channel)
      for (int k = 0; k <= 2 * l; ++k, ++at) sh[l * l + k][channel] = number(at);
}

struct RowReader {
  const Header& header;
  const Section& section;
  const Buckets* buckets;  // null at level 0
  glm::dvec3 origin;

  void operator()(const std::byte* row, std::size_t i, GaussianCloud& cloud, std::size_t to) const {
    const bool plain = header.level == 0;
    const auto number = [&](std::size_t k) {
      return plain ? load_as<float>(row + 4 * k)
                   : glm::unpackHalf1x16(load_as<std::uint16_t>(row + 2 * k));
    };
    for (int k = 0; k < 3; ++k) {
      const auto column = static_cast<std::size_t>(k);
      const double position = plain ? static_cast<double>(number(column)) : position_of(row, i, k);
      cloud.mean[to][k] = static_cast<float>(position - origin[k]);
      cloud.scale[to][k] = number(3 + column);
    }
    cloud.rotation[to] = unit(glm::quat(number(6), number(7), number(8), number(9)));
    const std::byte* colour = row + (plain ? 40 : 20);
    glm::vec3* sh = cloud.sh.data() + to * static_cast<std::size_t>(cloud.sh_count());
    for (int k = 0; k < 3; ++k)
      sh[0][k] = sh_from_colour(static_cast<float>(std::to_integer<int>(colour[k])) / 255.0f);
    cloud.opacity[to] = opacity_from_byte(std::to_integer<unsigned char>(colour[3]));
    const std::byte* rest = colour + 4;
    const auto sh_number = [&](std::size_t k) {
      if (header.level == 0) return load_as<float>(rest + 4 * k);
      if (header.level == 1) return glm::unpackHalf1x16(load_as<std::uint16_t>(rest + 2 * k));
      return header.sh_min + (header.sh_max - header.sh_min) *
                                 static_cast<float>(std::to_integer<int>(rest[k])) / 255.0f;
    };
    store_sh(sh_number, section.sh_degree, sh);
  }

 private:
  [[nodiscard]] double position_of(const std::byte* row, std::size_t i, int k) const {
    const double range = section.range;
    const double steps = static_cast<double>(load_as<std::uint16_t>(row + 2 * k)) - range;
    return steps * (0.5 * static_cast<double>(section.block_size) / range) +
           static_cast<double>(buckets->centre(i)[k]);
  }
};

}  // namespace

SceneSize read_ksplat_size(const ByteSource& file) {
  const Layout layout = read_layout(file);
  return {layout.header.count, layout.sh_degree};
}

GaussianCloud read_ksplat(const ByteSource& file, const LoadContext& context,
                          const glm::dvec3& origin) {
  const Layout layout = read_layout(file);
  GaussianCloud cloud;
  cloud.resize(layout.header.count, layout.sh_degree);
  const auto total = static_cast<double>(cloud.size());
  std::size_t first = 0;
  for (const Section& section : layout.sections) {
    std::optional<Buckets> buckets;
    if (layout.header.level > 0) buckets.emplace(file, section);
    const RowReader read{layout.header, section, buckets ? &*buckets : nullptr, origin};
    const LoadContext reading = context.part(static_cast<double>(first) / total,
                                             static_cast<double>(first + section.count) / total);
    reading.for_blocks(section.count, block_rows, [&](std::size_t begin, std::size_t end) {
      const std::vector<std::byte> rows =
          read_rows(file, section.rows_offset(), section.row_bytes, {0, section.count}, begin, end);
      for (std::size_t i = begin; i < end; ++i)
        read(&rows[(i - begin) * section.row_bytes], i, cloud, first + i);
    });
    first += section.count;
  }
  return cloud;
}

constexpr SceneFormat ksplat_format = {
    .name = "ksplat",
    .extensions = {".ksplat"},
    .is_mine = [](const ByteSource&, std::string_view extension) { return extension == ".ksplat"; },
    .size = [](const SceneFiles& files) { return read_ksplat_size(FileSource(files.path)); },
    .read = [](const SceneFiles& files, const LoadContext& context) -> DecodedScene {
      return read_about_origin([&](const glm::dvec3& origin) -> DecodedScene {
        return {"ksplat", read_ksplat(FileSource(files.path), context, origin)};
      });
    },
};

}  // namespace catgs
