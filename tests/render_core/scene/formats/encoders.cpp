#include "tests/render_core/scene/formats/encoders.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include <archive.h>
#include <archive_entry.h>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/gtc/packing.hpp>
#include <nlohmann/json.hpp>
#include <png.h>
#include <webp/encode.h>
#include <zlib.h>
#include <zstd.h>

#include "tests/support/temporary_folder.h"

namespace catgs::test {

namespace {

constexpr float sh_constant = 0.2820948f;

template <class T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void put_byte(std::string& out, double value) {
  out.push_back(static_cast<char>(std::clamp(std::lround(value), 0l, 255l)));
}

double logit_of(float opacity) { return std::log(opacity / (1.0 - static_cast<double>(opacity))); }

std::array<float, 4> wxyz(const glm::quat& q) { return {q.w, q.x, q.y, q.z}; }

std::size_t largest_of(const std::array<float, 4>& q) {
  const auto less = [](float a, float b) { return std::abs(a) < std::abs(b); };
  return static_cast<std::size_t>(std::max_element(q.begin(), q.end(), less) - q.begin());
}

/// Signs that the SH basis functions take when y and z turn around.
constexpr std::array<int, 16> sh_signs_yz = {1, -1, -1, 1,  -1, 1, 1,  -1,
                                             1, -1, 1,  -1, -1, 1, -1, 1};

/// A cloud with its y and z axes turned around.
GaussianCloud turned(GaussianCloud cloud) {
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i] *= glm::vec3(1, -1, -1);
    cloud.rotation[i].y *= -1.0f;
    cloud.rotation[i].z *= -1.0f;
    for (int k = 0; k < cloud.sh_count(); ++k)
      cloud.sh[i * cloud.sh_count() + k] *= static_cast<float>(sh_signs_yz[k]);
  }
  return cloud;
}

void put_spz_rotation(std::string& out, const glm::quat& q, int version) {
  if (version < 3) {
    const float sign = q.w < 0 ? -1.0f : 1.0f;
    for (const float v : {q.x, q.y, q.z}) put_byte(out, 127.5 * sign * v + 127.5);
    return;
  }
  const std::array<float, 4> xyzw = {q.x, q.y, q.z, q.w};
  const std::size_t largest = largest_of(xyzw);
  auto bits = static_cast<std::uint32_t>(largest);
  for (std::size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    const float v = xyzw[largest] < 0 ? -xyzw[k] : xyzw[k];
    bits = bits << 10 | (v < 0 ? 512u : 0u) |
           static_cast<std::uint32_t>(std::lround(511 * std::abs(v) / std::sqrt(0.5)));
  }
  put(out, bits);
}

std::vector<std::string> spz_streams(const GaussianCloud& cloud, const SpzStyle& style) {
  std::string positions, alphas, colours, scales, rotations, sh;
  const int stored_degree = std::max(cloud.sh_degree, style.extra_sh_degree);
  const int stored_count = sh_coefficient_count(stored_degree);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      if (style.version == 1) {
        put(positions, glm::packHalf1x16(cloud.mean[i][k]));
      } else {
        const long fixed = std::lround(std::ldexp(cloud.mean[i][k], style.fractional_bits));
        for (int shift = 0; shift < 24; shift += 8)
          positions.push_back(static_cast<char>(fixed >> shift));
      }
      put_byte(colours, 255.0 * (0.15 * cloud.sh_of(i)[0][k] + 0.5));
      put_byte(scales, 16.0 * (std::log(cloud.scale[i][k]) + 10.0));
    }
    put_byte(alphas, 255.0 * cloud.opacity[i]);
    put_spz_rotation(rotations, cloud.rotation[i], style.version);
    for (int k = 1; k < stored_count; ++k)
      for (int c = 0; c < 3; ++c)
        put_byte(sh, k < cloud.sh_count() ? 128.0 * cloud.sh_of(i)[k][c] + 128.0 : 77.0);
  }
  std::vector<std::string> streams = {positions, alphas, colours, scales, rotations};
  if (!sh.empty()) streams.push_back(sh);
  return streams;
}

std::string spz_extensions(const SpzStyle& style) {
  std::string out;
  if (style.coordinate_system != 0)
    for (const std::uint32_t word :
         {0x12340001u, 4u, 99u, 0xadbe0003u, 4u, style.coordinate_system})
      put(out, word);
  if (style.orbit) {
    for (const std::uint32_t word : {0xadbe0002u, 12u}) put(out, word);
    for (const float number :
         {style.orbit->min_elevation, style.orbit->max_elevation, style.orbit->min_radius})
      put(out, number);
  }
  return out;
}

std::string zstd(const std::string& bytes) {
  std::string out(ZSTD_compressBound(bytes.size()), '\0');
  out.resize(ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), 3));
  return out;
}

}  // namespace

std::string gzip(const std::string& bytes) {
  z_stream stream{};
  deflateInit2(&stream, 6, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  if (deflate(&stream, Z_FINISH) != Z_STREAM_END) throw std::runtime_error("deflate");
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::map<std::string, std::string> files_below(const std::filesystem::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[entry.path().lexically_relative(folder).string()] = content_of(entry.path());
  return files;
}

std::string zip(const std::map<std::string, std::string>& files, bool deflated) {
  std::string out;
  archive* zip = archive_write_new();
  archive_write_set_format_zip(zip);
  deflated ? archive_write_zip_set_compression_deflate(zip)
           : archive_write_zip_set_compression_store(zip);
  archive_write_set_bytes_per_block(zip, 0);
  archive_write_open(
      zip, &out, nullptr,
      [](archive*, void* to, const void* data, std::size_t size) {
        static_cast<std::string*>(to)->append(static_cast<const char*>(data), size);
        return static_cast<la_ssize_t>(size);
      },
      nullptr);
  for (const auto& [name, content] : files) {
    archive_entry* entry = archive_entry_new();
    archive_entry_set_pathname(entry, name.c_str());
    archive_entry_set_filetype(entry, AE_IFREG);
    archive_entry_set_size(entry, static_cast<la_int64_t>(content.size()));
    archive_write_header(zip, entry);
    archive_write_data(zip, content.data(), content.size());
    archive_entry_free(entry);
  }
  archive_write_free(zip);
  return out;
}

std::string encode_spz(const GaussianCloud& cloud, const SpzStyle& style) {
  const auto streams = spz_streams(style.coordinate_system == 0 ? turned(cloud) : cloud, style);
  const std::string extensions = spz_extensions(style);
  std::string out;
  put(out, std::uint32_t{0x5053474e});
  put(out, static_cast<std::uint32_t>(style.version));
  put(out, static_cast<std::uint32_t>(cloud.size()));
  out.push_back(static_cast<char>(std::max(cloud.sh_degree, style.extra_sh_degree)));
  out.push_back(static_cast<char>(style.fractional_bits));
  out.push_back(extensions.empty() ? 0 : 2);
  if (style.version < 4) {
    out.push_back(0);
    for (const std::string& stream : streams) out += stream;
    return gzip(out + extensions);
  }
  out.push_back(static_cast<char>(streams.size()));
  put(out, static_cast<std::uint32_t>(32 + extensions.size()));
  out.append(12, '\0');
  out += extensions;
  std::string compressed;
  for (const std::string& stream : streams) {
    const std::string piece = zstd(stream);
    put(out, std::uint64_t{piece.size()});
    put(out, std::uint64_t{stream.size()});
    compressed += piece;
  }
  return out + compressed;
}

std::string encode_compressed_ply(const GaussianCloud& cloud, bool colour_limits) {
  const std::size_t count = cloud.size(), chunks = (count + 255) / 256;
  const int rest = cloud.sh_count() - 1;
  std::string header =
      "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
  const auto properties = [&](const std::string& type, std::initializer_list<const char*> names) {
    for (const char* name : names) header += "property " + type + " " + name + "\n";
  };
  properties("float", {"min_x", "min_y", "min_z", "max_x", "max_y", "max_z", "min_scale_x",
                       "min_scale_y", "min_scale_z", "max_scale_x", "max_scale_y", "max_scale_z"});
  if (colour_limits) properties("float", {"min_r", "min_g", "min_b", "max_r", "max_g", "max_b"});
  header += "element vertex " + std::to_string(count) + "\n";
  properties("uint", {"packed_position", "packed_rotation", "packed_scale", "packed_color"});
  if (rest > 0) header += "element sh " + std::to_string(count) + "\n";
  for (int k = 0; k < 3 * rest; ++k) properties("uchar", {("f_rest_" + std::to_string(k)).c_str()});

  std::string chunk_rows, vertices, sh;
  for (std::size_t begin = 0; begin < count; begin += 256) {
    const std::size_t end = std::min(count, begin + 256);
    struct Limits {
      glm::vec3 min{std::numeric_limits<float>::max()}, max{-std::numeric_limits<float>::max()};
      void add(const glm::vec3& v) { min = glm::min(min, v), max = glm::max(max, v); }
    } position, scale, colour;
    const auto log_scale = [&](std::size_t i) { return glm::log(cloud.scale[i]); };
    const auto rgb = [&](std::size_t i) { return 0.5f + sh_constant * cloud.sh_of(i)[0]; };
    for (std::size_t i = begin; i < end; ++i) {
      position.add(cloud.mean[i]);
      scale.add(log_scale(i));
      colour.add(rgb(i));
    }
    if (!colour_limits) colour = {glm::vec3(0.0f), glm::vec3(1.0f)};
    for (const glm::vec3& v : {position.min, position.max, scale.min, scale.max})
      put(chunk_rows, v);
    if (colour_limits) put(chunk_rows, colour.min), put(chunk_rows, colour.max);
    const auto bits = [](float v, float min, float max, int n) {
      const float t = max > min ? std::clamp((v - min) / (max - min), 0.0f, 1.0f) : 0.0f;
      return static_cast<std::uint32_t>(std::lround(t * static_cast<float>((1 << n) - 1)));
    };
    const auto pack = [&](const glm::vec3& v, const Limits& l) {
      return bits(v.x, l.min.x, l.max.x, 11) << 21 | bits(v.y, l.min.y, l.max.y, 10) << 11 |
             bits(v.z, l.min.z, l.max.z, 11);
    };
    for (std::size_t i = begin; i < end; ++i) {
      put(vertices, pack(cloud.mean[i], position));
      const auto q = wxyz(cloud.rotation[i]);
      const std::size_t largest = largest_of(q);
      auto rotation = static_cast<std::uint32_t>(largest);
      for (std::size_t k = 0; k < 4; ++k)
        if (k != largest)
          rotation = rotation << 10 |
                     bits(q[largest] < 0 ? -q[k] : q[k], -std::sqrt(0.5f), std::sqrt(0.5f), 10);
      put(vertices, rotation);
      put(vertices, pack(log_scale(i), scale));
      const glm::vec3 c = rgb(i);
      put(vertices, bits(c.r, colour.min.r, colour.max.r, 8) << 24 |
                        bits(c.g, colour.min.g, colour.max.g, 8) << 16 |
                        bits(c.b, colour.min.b, colour.max.b, 8) << 8 |
                        bits(cloud.opacity[i], 0.0f, 1.0f, 8));
      for (int channel = 0; channel < 3; ++channel)
        for (int k = 1; k <= rest; ++k)
          sh.push_back(static_cast<char>(
              std::clamp(static_cast<int>((cloud.sh_of(i)[k][channel] / 8 + 0.5f) * 256), 0, 255)));
    }
  }
  return header + "end_header\n" + chunk_rows + vertices + sh;
}

std::string encode_webp(const std::string& rgba, int width, int height, bool lossless) {
  WebPConfig config;
  WebPConfigInit(&config);
  WebPConfigLosslessPreset(&config, 0);
  config.lossless = lossless;
  config.exact = 1;  // keep the colours of transparent texels
  WebPPicture picture;
  WebPPictureInit(&picture);
  picture.use_argb = lossless;
  picture.width = width;
  picture.height = height;
  WebPPictureImportRGBA(&picture, reinterpret_cast<const std::uint8_t*>(rgba.data()), 4 * width);
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  if (!WebPEncode(&config, &picture)) throw std::runtime_error("WebPEncode");
  std::string out(reinterpret_cast<const char*>(writer.mem), writer.size);
  WebPMemoryWriterClear(&writer);
  WebPPictureFree(&picture);
  return out;
}

std::string encode_png(const std::string& rgba, int width, int height, bool alpha) {
  std::string texels;
  for (std::size_t i = 0; i < rgba.size(); i += 4) texels += rgba.substr(i, alpha ? 4 : 3);
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = static_cast<png_uint_32>(width);
  image.height = static_cast<png_uint_32>(height);
  image.format = alpha ? PNG_FORMAT_RGBA : PNG_FORMAT_RGB;
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(image);
  std::string out(size, '\0');
  if (!png_image_write_to_memory(&image, out.data(), &size, 0, texels.data(), 0, nullptr))
    throw std::runtime_error(image.message);
  out.resize(size);
  return out;
}

namespace {

/// 256 ascending values over the range of `values`, and the nearest of them.
struct Steps {
  double min = std::numeric_limits<double>::max(), max = -min;
  void add(double v) { min = std::min(min, v), max = std::max(max, v); }
  [[nodiscard]] double byte(double v) const { return 255.0 * (v - min) / (max - min); }
  [[nodiscard]] nlohmann::json codebook() const {
    nlohmann::json values;
    for (int b = 0; b < 256; ++b) values.push_back(min + (max - min) * b / 255.0);
    return values;
  }
};

double log_mean(float v) { return std::copysign(std::log(std::abs(v) + 1.0), v); }

}  // namespace

std::map<std::string, std::string> encode_sog(const GaussianCloud& cloud, int version) {
  const std::size_t count = cloud.size();
  const int rest = cloud.sh_count() - 1;
  const int width = 4 * static_cast<int>(std::ceil(std::sqrt(static_cast<double>(count)) / 4.0));
  const int height = static_cast<int>((count + static_cast<std::size_t>(width) - 1) /
                                      static_cast<std::size_t>(width));
  std::array<Steps, 3> mean, scale, sh0;
  Steps opacity, sh_rest, all_scales, all_sh0;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int axis = static_cast<int>(k);
      mean[k].add(log_mean(cloud.mean[i][axis]));
      scale[k].add(std::log(cloud.scale[i][axis]));
      all_scales.add(std::log(cloud.scale[i][axis]));
      sh0[k].add(cloud.sh_of(i)[0][axis]);
      all_sh0.add(cloud.sh_of(i)[0][axis]);
      for (int c = 1; c <= rest; ++c) sh_rest.add(cloud.sh_of(i)[c][axis]);
    }
    opacity.add(logit_of(cloud.opacity[i]));
  }
  if (version == 2) {
    scale.fill(all_scales);
    sh0.fill(all_sh0);
  }

  std::string low, high, quats, scales, colours, labels, centroids;
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int axis = static_cast<int>(k);
      const long steps = std::lround(257.0 * mean[k].byte(log_mean(cloud.mean[i][axis])));
      low.push_back(static_cast<char>(steps & 255));
      high.push_back(static_cast<char>(steps >> 8));
      put_byte(scales, scale[k].byte(std::log(cloud.scale[i][axis])));
      put_byte(colours, sh0[k].byte(cloud.sh_of(i)[0][axis]));
    }
    for (std::string* image : {&low, &high, &scales}) image->push_back('\xff');
    put_byte(colours,
             version == 1 ? opacity.byte(logit_of(cloud.opacity[i])) : 255.0 * cloud.opacity[i]);
    const auto q = wxyz(cloud.rotation[i]);
    const std::size_t largest = largest_of(q);
    for (std::size_t k = 0; k < 4; ++k)
      if (k != largest)
        put_byte(quats, 255.0 * ((q[largest] < 0 ? -q[k] : q[k]) / std::sqrt(2.0) + 0.5));
    quats.push_back(static_cast<char>(252 + largest));
    labels.push_back(static_cast<char>(i & 255));
    labels.push_back(static_cast<char>(i >> 8));
    labels.append("\0\xff", 2);
    for (int c = 1; c <= rest; ++c) {
      for (int k = 0; k < 3; ++k) put_byte(centroids, sh_rest.byte(cloud.sh_of(i)[c][k]));
      centroids.push_back('\xff');
    }
  }

  std::map<std::string, std::string> files;
  const auto image = [&](const std::string& name, std::string texels, int w, int h) {
    texels.resize(4 * static_cast<std::size_t>(w) * static_cast<std::size_t>(h), '\0');
    files[name] = encode_webp(texels, w, h);
  };
  image("means_l.webp", low, width, height);
  image("means_u.webp", high, width, height);
  image("quats.webp", quats, width, height);
  image("scales.webp", scales, width, height);
  image("sh0.webp", colours, width, height);
  const auto three = [](const std::array<Steps, 3>& steps, double Steps::*end) {
    return nlohmann::json{steps[0].*end, steps[1].*end, steps[2].*end};
  };
  nlohmann::json meta = {{"means",
                          {{"mins", three(mean, &Steps::min)},
                           {"maxs", three(mean, &Steps::max)},
                           {"files", {"means_l.webp", "means_u.webp"}}}},
                         {"scales", {{"files", {"scales.webp"}}}},
                         {"quats", {{"files", {"quats.webp"}}}},
                         {"sh0", {{"files", {"sh0.webp"}}}}};
  if (version == 1) {
    meta["means"]["shape"] = {count, 3};
    meta["scales"]["mins"] = three(scale, &Steps::min);
    meta["scales"]["maxs"] = three(scale, &Steps::max);
    meta["sh0"]["mins"] = {sh0[0].min, sh0[1].min, sh0[2].min, opacity.min};
    meta["sh0"]["maxs"] = {sh0[0].max, sh0[1].max, sh0[2].max, opacity.max};
  } else {
    meta["version"] = 2;
    meta["count"] = count;
    meta["scales"]["codebook"] = all_scales.codebook();
    meta["sh0"]["codebook"] = all_sh0.codebook();
  }
  if (rest > 0) {
    image("shN_centroids.webp", centroids, 64 * rest, static_cast<int>((count + 63) / 64));
    image("shN_labels.webp", labels, width, height);
    meta["shN"]["files"] = {"shN_centroids.webp", "shN_labels.webp"};
    if (version == 1) {
      meta["shN"]["mins"] = sh_rest.min;
      meta["shN"]["maxs"] = sh_rest.max;
    } else {
      meta["shN"]["codebook"] = sh_rest.codebook();
      meta["shN"]["count"] = count;
      meta["shN"]["bands"] = cloud.sh_degree;
    }
  }
  files["meta.json"] = meta.dump();
  return files;
}

}  // namespace catgs::test
