#include "tests/render_core/scene/formats/ksplat_encoder.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include <glm/gtc/packing.hpp>

#include "render_core/math/constants.h"

namespace catgs::test {

namespace {

constexpr float block_size = 64.0f;

template <class T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

template <class T>
void set(std::string& out, std::size_t at, T value) {
  std::memcpy(out.data() + at, &value, sizeof value);
}

void put_byte(std::string& out, double value) {
  out.push_back(static_cast<char>(std::clamp(std::lround(value), 0l, 255l)));
}

struct Range {
  std::size_t begin, end;
};

std::vector<Range> buckets_of(Range rows, const KsplatStyle& style) {
  std::vector<Range> buckets;
  for (; rows.end - rows.begin >= style.bucket_rows; rows.begin += style.bucket_rows)
    buckets.push_back({rows.begin, rows.begin + style.bucket_rows});
  const std::size_t middle = rows.begin + (rows.end - rows.begin) / 3;
  buckets.push_back({rows.begin, middle});
  buckets.push_back({middle, rows.end});
  return buckets;
}

void put_row(std::string& out, const GaussianCloud& cloud, std::size_t i, const glm::vec3& centre,
             int level) {
  const auto number = [&](float value) {
    level == 0 ? put(out, value) : put(out, glm::packHalf1x16(value));
  };
  for (int k = 0; k < 3; ++k)
    level == 0 ? put(out, cloud.mean[i][k])
               : put(out, static_cast<std::uint16_t>(std::lround(
                              (cloud.mean[i][k] - centre[k]) / (block_size / 2) * 32767 + 32767)));
  for (int k = 0; k < 3; ++k) number(cloud.scale[i][k]);
  const glm::quat& q = cloud.rotation[i];
  for (const float v : {q.w, q.x, q.y, q.z}) number(v);
  for (int k = 0; k < 3; ++k) put_byte(out, 255 * (0.5 + sh_basis_0 * cloud.sh_of(i)[0][k]));
  put_byte(out, 255 * cloud.opacity[i]);
  for (int degree = 1; degree <= cloud.sh_degree; ++degree)
    for (int channel = 0; channel < 3; ++channel)
      for (int k = degree * degree; k < (degree + 1) * (degree + 1); ++k) {
        const float value = cloud.sh_of(i)[k][channel];
        level < 2 ? number(value) : put_byte(out, 255 * (value + 1.5) / 3);
      }
}

/// The header and the data of a section.
std::pair<std::string, std::string> section_of(const GaussianCloud& cloud, Range rows,
                                               const KsplatStyle& style) {
  std::string header(1024, '\0'), lengths, centres, data;
  const auto count = static_cast<std::uint32_t>(rows.end - rows.begin);
  set(header, 0, count);
  set(header, 4, count + 3);  // room for more
  set(header, 40, static_cast<std::uint16_t>(cloud.sh_degree));
  const std::vector<Range> buckets = buckets_of(rows, style);
  for (const Range& bucket : buckets) {
    glm::vec3 centre(0.0f);
    for (std::size_t i = bucket.begin; i < bucket.end; ++i)
      centre += cloud.mean[i] / static_cast<float>(bucket.end - bucket.begin);
    put(centres, centre);
    for (std::size_t i = bucket.begin; i < bucket.end; ++i)
      put_row(data, cloud, i, centre, style.level);
    if (&bucket + 2 > &buckets.back())
      put(lengths, static_cast<std::uint32_t>(bucket.end - bucket.begin));
  }
  const std::size_t row_bytes = count ? data.size() / count : 0;
  if (count)
    data.append(3 * row_bytes, '\x55');
  else
    set(header, 4, std::uint32_t{0});
  if (style.level == 0) return {header, data};
  set(header, 8, static_cast<std::uint32_t>(style.bucket_rows));
  set(header, 12, static_cast<std::uint32_t>(buckets.size()));
  set(header, 16, block_size);
  set(header, 20, std::uint16_t{12});
  set(header, 24, std::uint32_t{32767});
  set(header, 32, static_cast<std::uint32_t>(buckets.size() - 2));
  set(header, 36, std::uint32_t{2});
  return {header, lengths + centres + data};
}

}  // namespace

std::string encode_ksplat(const GaussianCloud& cloud, const KsplatStyle& style) {
  std::string header(4096, '\0'), sections, data;
  const auto add = [&](Range rows) {
    const auto [section_header, section_data] = section_of(cloud, rows, style);
    sections += section_header;
    data += section_data;
  };
  for (std::size_t s = 0; s < style.sections; ++s) {
    if (s > 0) add({0, 0});
    add({cloud.size() * s / style.sections, cloud.size() * (s + 1) / style.sections});
  }
  const auto count = static_cast<std::uint32_t>(cloud.size());
  header[1] = 1;  // version 0.1
  set(header, 4, static_cast<std::uint32_t>(2 * style.sections - 1));
  set(header, 8, static_cast<std::uint32_t>(2 * style.sections - 1));
  set(header, 12, count);
  set(header, 16, count);
  set(header, 20, static_cast<std::uint16_t>(style.level));
  set(header, 36, -1.5f);
  set(header, 40, 1.5f);
  return header + sections + data;
}

}  // namespace catgs::test
