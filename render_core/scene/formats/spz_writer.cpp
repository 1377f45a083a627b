#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <zlib.h>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/axes.h"
#include "render_core/scene/formats/losses.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/formats/spz_format.h"
#include "render_core/scene/formats/stored_positions.h"

namespace catgs {

namespace {

using namespace spz;

constexpr int version = 3;
// Usual scenes have the first. Those of small Gaussians have more, as the format's 24 bits allow.
constexpr int usual_fractional_bits = 16, max_fractional_bits = 23;
constexpr float steps_of_median = 64.0f;  // or more, in a scale of the median Gaussian
constexpr int position_bits = 23;         // and a sign
// The precision of Niantic's writer. Bits of mere noise would double the file.
constexpr int sh1_bits = 5;
constexpr int sh_rest_bits = 4;

class GzipWriter {
 public:
  explicit GzipWriter(std::ostream& to) : to_(to) {
    constexpr int gzip = 16, memory_level = 9;
    if (deflateInit2(&stream_, Z_DEFAULT_COMPRESSION, Z_DEFLATED, gzip + MAX_WBITS, memory_level,
                     Z_DEFAULT_STRATEGY) != Z_OK)
      throw std::bad_alloc();
  }
  ~GzipWriter() { deflateEnd(&stream_); }
  GzipWriter(const GzipWriter&) = delete;
  GzipWriter& operator=(const GzipWriter&) = delete;

  void write(std::string& bytes) { deflate_all(bytes, Z_NO_FLUSH); }
  void finish() {
    std::string none;
    deflate_all(none, Z_FINISH);
  }

 private:
  void deflate_all(std::string& bytes, int flush) {
    stream_.next_in = reinterpret_cast<Bytef*>(bytes.data());
    stream_.avail_in = static_cast<uInt>(bytes.size());
    do {
      stream_.next_out = reinterpret_cast<Bytef*>(buffer_.data());
      stream_.avail_out = static_cast<uInt>(buffer_.size());
      deflate(&stream_, flush);
      to_.write(buffer_.data(), static_cast<std::streamsize>(buffer_.size() - stream_.avail_out));
    } while (stream_.avail_out == 0);
  }

  std::ostream& to_;
  z_stream stream_{};
  std::vector<char> buffer_ = std::vector<char>(256 * 1024);
};

StoredPositions stored_positions(const GaussianCloud& cloud) {
  return {cloud, [](float coordinate) { return coordinate; }, 1 << (position_bits + 1)};
}

int fractional_bits_for(const StoredPositions& points) {
  float largest = 0.0f;
  for (const glm::vec3& m : points.mean())
    largest = std::max({largest, std::abs(m.x), std::abs(m.y), std::abs(m.z)});
  std::vector<float> sizes;
  for (const glm::vec3& scale : points.scale()) sizes.push_back(middle_scale(scale));
  const auto median = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::ranges::nth_element(sizes, median);
  int bits = usual_fractional_bits;
  while (bits < max_fractional_bits && std::ldexp(*median, bits) < steps_of_median) ++bits;
  const auto fits = [&] {
    return std::ldexp(largest, bits) < static_cast<float>((1 << position_bits) - 1);
  };
  while (bits > 0 && !fits()) --bits;
  if (!fits())
    throw InputError("", "mean", fmt::format("a coordinate of {} does not fit into .spz", largest),
                     "scale the scene down");
  return bits;
}

void append_fixed24(std::string& out, float value, int fractional_bits) {
  const auto fixed = std::lround(std::ldexp(value, fractional_bits));
  for (int shift = 0; shift < 24; shift += 8) out.push_back(static_cast<char>(fixed >> shift));
}

void append_smallest_three(std::string& out, const glm::quat& q) {
  const std::array<float, 4> xyzw = {q.x, q.y, q.z, q.w};
  std::uint32_t largest = 0;
  for (std::uint32_t k = 1; k < 4; ++k)
    if (std::abs(xyzw[k]) > std::abs(xyzw[largest])) largest = k;
  const float sign = xyzw[largest] < 0.0f ? -1.0f : 1.0f;  // -q is the same rotation
  std::uint32_t bits = largest;
  for (std::uint32_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const float value = sign * xyzw[k];
    const auto magnitude =
        static_cast<std::uint32_t>(std::lround(std::abs(value) / magnitude_unit));
    bits = bits << 10 | (value < 0.0f ? max_magnitude + 1 : 0) | std::min(magnitude, max_magnitude);
  }
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<char>(bits >> shift));
}

/// Nearest multiple of 2^(8 - bits) on the scale where 128 is 0; 0 stays exact.
char quantised_sh(float value, int bits) {
  const int step = 1 << (8 - bits);
  const auto steps = static_cast<int>(
      std::lround(std::clamp(value, -1.0f, 1.0f) * 128.0f / static_cast<float>(step)));
  return static_cast<char>(std::clamp(128 + steps * step, 0, 255));
}

}  // namespace

std::vector<std::string> spz_losses(const GaussianCloud& cloud) {
  Losses losses(cloud);
  const StoredPositions points = stored_positions(cloud);
  losses.moved(points.mean());
  const float step = std::ldexp(1.0f, -fractional_bits_for(points));
  losses.positions([step](const glm::vec3&) { return step; });
  const float half_step = 0.5f / log_scale_steps;
  losses.scales(std::exp(least_log_scale - half_step),
                std::exp(least_log_scale + 255.0f / log_scale_steps + half_step));
  losses.harmonics(0, 0, -most_sh0, most_sh0,
                   fmt::format("colours outside of {:.2f}…{:.2f}", colour_from_sh(-most_sh0),
                               colour_from_sh(most_sh0)));
  losses.harmonics(1, max_sh_degree, -1.0f, 1.0f, "harmonics outside of -1…1");
  return std::move(losses).notes();
}

void write_spz(const GaussianCloud& cloud, std::ostream& to) {
  const AxisFlip flip(right_up_back);
  const StoredPositions points = stored_positions(cloud);
  const int fractional_bits = fractional_bits_for(points);
  GzipWriter gzip(to);

  std::string header(gzip_header_bytes, '\0');
  const std::array<std::uint32_t, 3> words = {magic, version,
                                              static_cast<std::uint32_t>(cloud.size())};
  std::copy_n(reinterpret_cast<const char*>(words.data()), sizeof words, header.begin());
  header[12] = static_cast<char>(cloud.sh_degree);
  header[13] = static_cast<char>(fractional_bits);
  if (cloud.model == SplatModel::antialiased) header[14] = static_cast<char>(antialiased_flag);
  gzip.write(header);

  const auto write_attribute = [&](const std::function<void(std::string&, std::size_t)>& append) {
    constexpr std::size_t rows = 4096;
    std::string block;
    for (std::size_t begin = 0; begin < cloud.size(); begin += rows) {
      block.clear();
      for (std::size_t i = begin; i < std::min(cloud.size(), begin + rows); ++i) append(block, i);
      gzip.write(block);
    }
  };
  const auto append_byte = [](std::string& out, float value) {
    out.push_back(static_cast<char>(to_byte(value)));
  };
  write_attribute([&](std::string& out, std::size_t i) {
    const glm::vec3 mean = flip.mean(points.mean()[i]);
    for (int k = 0; k < 3; ++k) append_fixed24(out, mean[k], fractional_bits);
  });
  write_attribute(
      [&](std::string& out, std::size_t i) { append_byte(out, 255.0f * cloud.opacity[i]); });
  write_attribute([&](std::string& out, std::size_t i) {
    for (int k = 0; k < 3; ++k)
      append_byte(out, 255.0f * (colour_scale * cloud.sh_of(i)[0][k] + 0.5f));
  });
  write_attribute([&](std::string& out, std::size_t i) {
    for (int k = 0; k < 3; ++k)
      append_byte(out, log_scale_steps * (std::log(points.scale()[i][k]) - least_log_scale));
  });
  write_attribute([&](std::string& out, std::size_t i) {
    append_smallest_three(out, flip.rotation(cloud.rotation[i]));
  });
  write_attribute([&](std::string& out, std::size_t i) {
    for (int k = 1; k < cloud.sh_count(); ++k)
      for (int c = 0; c < 3; ++c)
        out.push_back(quantised_sh(flip.sh(static_cast<std::size_t>(k)) * cloud.sh_of(i)[k][c],
                                   k < 4 ? sh1_bits : sh_rest_bits));
  });
  gzip.finish();
}

}  // namespace catgs
