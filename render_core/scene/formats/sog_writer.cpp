#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <new>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>
#include <webp/encode.h>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/formats/losses.h"
#include "render_core/scene/formats/palette.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/stored_positions.h"
#include "render_core/scene/formats/zip_writer.h"

namespace catgs {

namespace {

constexpr std::size_t max_palette = 65536, palette_row = 64;
constexpr std::size_t codebook_sample = std::size_t{1} << 16;  // triples
constexpr std::size_t max_texels_across = 16383;               // of a WebP image
constexpr float mean_steps = 65535.0f;                         // in the range of an axis
// WebP knows efforts of 0 to 9. Bytes that look like noise become 6 % larger in a third of the
// time. The labels would become half as large again.
constexpr int effort = 1, effort_for_noise = 0;

/// A texel per Gaussian, or per coefficient of the palette.
class Image {
 public:
  Image(std::size_t width, std::size_t height)
      : width_(width), height_(height), rgba_(4 * width * height) {}

  void set(std::size_t i, std::uint8_t r, std::uint8_t g, std::uint8_t b, std::uint8_t a) {
    const std::array<std::uint8_t, 4> texel = {r, g, b, a};
    std::copy(texel.begin(), texel.end(), rgba_.begin() + static_cast<std::ptrdiff_t>(4 * i));
  }
  /// As lossless WebP.
  [[nodiscard]] std::string encoded(int effort_of_webp) const;

 private:
  std::size_t width_, height_;
  std::vector<std::uint8_t> rgba_;
};

std::string Image::encoded(int effort_of_webp) const {
  WebPConfig config;
  WebPPicture picture;
  if (!WebPConfigInit(&config) || !WebPConfigLosslessPreset(&config, effort_of_webp) ||
      !WebPPictureInit(&picture))
    throw std::bad_alloc();
  config.exact = 1;  // keeps the colours of texels whose fourth channel is 0
  picture.use_argb = 1;
  picture.width = static_cast<int>(width_);
  picture.height = static_cast<int>(height_);
  std::string bytes;
  picture.writer = [](const std::uint8_t* data, std::size_t size, const WebPPicture* of) {
    static_cast<std::string*>(of->custom_ptr)->append(reinterpret_cast<const char*>(data), size);
    return 1;
  };
  picture.custom_ptr = &bytes;
  const bool done = WebPPictureImportRGBA(&picture, rgba_.data(), static_cast<int>(4 * width_)) &&
                    WebPEncode(&config, &picture);
  WebPPictureFree(&picture);
  if (!done) throw std::bad_alloc();  // the only error of valid arguments
  return bytes;
}

/// The codebook is found for an even sample and the limits of the triples that `triple_of` has for
/// [0, count).
template <class TripleOf>
Codebook codebook_of(std::size_t count, const TripleOf& triple_of) {
  const std::size_t taken = std::min(count, codebook_sample);
  std::vector<float> values;
  for (std::size_t i = 0; i < taken; ++i) {
    const glm::vec3 triple = triple_of(i * count / taken);
    values.insert(values.end(), {triple.x, triple.y, triple.z});
  }
  float low = std::numeric_limits<float>::max(), high = std::numeric_limits<float>::lowest();
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 triple = triple_of(i);
    low = std::min({low, triple.x, triple.y, triple.z});
    high = std::max({high, triple.x, triple.y, triple.z});
  }
  values.insert(values.end(), {low, high});
  return Codebook(std::move(values));
}

double log_mean(double v) { return std::copysign(std::log1p(std::abs(v)), v); }

StoredPositions stored_positions(const GaussianCloud& cloud) {
  return {cloud, [](float v) { return static_cast<float>(log_mean(v)); }, mean_steps};
}

class Writer {
 public:
  Writer(const GaussianCloud& cloud, ThreadPool& pool)
      : cloud_(cloud),
        positions_(stored_positions(cloud)),
        pool_(pool),
        order_(morton_order(cloud.mean, pool)) {
    const double side = std::sqrt(static_cast<double>(cloud.size()));
    width_ = 4 * static_cast<std::size_t>(std::ceil(side / 4.0));
    height_ = (cloud.size() + width_ - 1) / width_;
    if (width_ > max_texels_across)
      throw InputError("", "size", fmt::format("{} Gaussians do not fit into .sog", cloud.size()),
                       "prune the scene, or write .tree");
    meta_ = {{"version", 2}, {"asset", {{"generator", "CaT-GS"}}}, {"count", cloud.size()}};
    if (cloud.model != SplatModel::standard) meta_["model"] = name_of(cloud.model);
  }

  /// The files of the archive.
  std::map<std::string, std::string> files() {
    // The steps share nothing, because each stores under names of its own. The longest is
    // first.
    std::vector<std::function<void()>> steps;
    if (cloud_.sh_degree > 0) steps.emplace_back([this] { rest(); });
    steps.emplace_back([this] { means(); });
    steps.emplace_back([this] { colours(); });
    steps.emplace_back([this] { scales(); });
    steps.emplace_back([this] { rotations(); });
    prepare();
    pool_.parallel_for(steps.size(), [&](std::size_t i) { steps[i](); });
    files_["meta.json"] = meta_.dump();
    return std::move(files_);
  }

 private:
  /// Makes every entry before threads fill them.
  void prepare() {
    const auto add = [&](const char* attribute, std::initializer_list<const char*> names) {
      for (const char* name : names) {
        files_[name];
        meta_[attribute]["files"].push_back(name);
      }
    };
    add("means", {"means_l.webp", "means_u.webp"});
    add("scales", {"scales.webp"});
    add("quats", {"quats.webp"});
    add("sh0", {"sh0.webp"});
    if (cloud_.sh_degree > 0) add("shN", {"shN_centroids.webp", "shN_labels.webp"});
  }

  /// An image of the Gaussians. `texel` tells the four bytes of one.
  template <class Texel>
  void store(const char* name, int effort_of_webp, const Texel& texel) {
    Image image(width_, height_);
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const std::array<std::uint8_t, 4> rgba = texel(order_[i]);
      image.set(i, rgba[0], rgba[1], rgba[2], rgba[3]);
    }
    files_.at(name) = image.encoded(effort_of_webp);
  }

  void means() {
    std::vector<glm::dvec3> logarithms(cloud_.size());
    glm::dvec3 low(std::numeric_limits<double>::max()), high(std::numeric_limits<double>::lowest());
    for (std::size_t i = 0; i < cloud_.size(); ++i) {
      const glm::dvec3 m(positions_.mean()[i]);
      logarithms[i] = {log_mean(m.x), log_mean(m.y), log_mean(m.z)};
      low = glm::min(low, logarithms[i]);
      high = glm::max(high, logarithms[i]);
    }
    const glm::dvec3 steps = double{mean_steps} / glm::max(high - low, 1e-20);
    const auto store_byte = [&](const char* name, int effort_of_webp, int shift) {
      store(name, effort_of_webp, [&](std::size_t i) {
        const glm::dvec3 at = glm::clamp((logarithms[i] - low) * steps, 0.0, double{mean_steps});
        const auto byte = [&](double v) {
          return static_cast<std::uint8_t>(static_cast<int>(v + 0.5) >> shift & 255);
        };
        return std::array<std::uint8_t, 4>{byte(at.x), byte(at.y), byte(at.z), 255};
      });
    };
    store_byte("means_l.webp", effort_for_noise, 0);
    store_byte("means_u.webp", effort, 8);
    meta_.at("means")["mins"] = {low.x, low.y, low.z};
    meta_.at("means")["maxs"] = {high.x, high.y, high.z};
  }

  /// The three smaller components as bytes; the fourth byte names the largest, which is positive.
  void rotations() {
    store("quats.webp", effort_for_noise, [&](std::size_t i) {
      const glm::quat& q = cloud_.rotation[i];
      const std::array<float, 4> wxyz = {q.w, q.x, q.y, q.z};
      std::size_t largest = 0;
      for (std::size_t k = 1; k < 4; ++k)
        if (std::abs(wxyz[k]) > std::abs(wxyz[largest])) largest = k;
      const float scale = std::copysign(255.0f / 1.41421356f, wxyz[largest]);
      std::array<std::uint8_t, 4> texel{};
      std::size_t stored = 0;
      for (std::size_t k = 0; k < 4; ++k)
        if (k != largest) texel[stored++] = to_byte(scale * wxyz[k] + 127.5f);
      texel[3] = static_cast<std::uint8_t>(252 + largest);
      return texel;
    });
  }

  void scales() {
    const auto log_scale = [&](std::size_t i, int k) { return std::log(positions_.scale()[i][k]); };
    const Codebook book = codebook_of(cloud_.size(), [&](std::size_t i) {
      return glm::vec3(log_scale(i, 0), log_scale(i, 1), log_scale(i, 2));
    });
    store("scales.webp", effort_for_noise, [&](std::size_t i) {
      return std::array<std::uint8_t, 4>{book.nearest(log_scale(i, 0)),
                                         book.nearest(log_scale(i, 1)),
                                         book.nearest(log_scale(i, 2)), 255};
    });
    meta_.at("scales")["codebook"] = book.values();
  }

  void colours() {
    const Codebook book =
        codebook_of(cloud_.size(), [&](std::size_t i) { return cloud_.sh_of(i)[0]; });
    store("sh0.webp", effort_for_noise, [&](std::size_t i) {
      const glm::vec3& sh = cloud_.sh_of(i)[0];
      return std::array<std::uint8_t, 4>{book.nearest(sh.x), book.nearest(sh.y), book.nearest(sh.z),
                                         to_byte(255.0f * cloud_.opacity[i])};
    });
    meta_.at("sh0")["codebook"] = book.values();
  }

  void rest() {
    const auto coefficients = static_cast<std::size_t>(cloud_.sh_count() - 1);
    const VectorTable vectors{&cloud_.sh_of(0)[1].x, cloud_.size(), 3 * (coefficients + 1),
                              3 * coefficients};
    const Palette palette = make_palette(vectors, std::min(cloud_.size(), max_palette), pool_);
    const std::size_t texels = palette.entries.size() / 3, entries = texels / coefficients;
    const Codebook book = codebook_of(texels, [&](std::size_t i) {
      const float* v = &palette.entries[3 * i];
      return glm::vec3(v[0], v[1], v[2]);
    });
    Image centroids(palette_row * coefficients, (entries + palette_row - 1) / palette_row);
    for (std::size_t i = 0; i < texels; ++i) {
      const float* v = &palette.entries[3 * i];
      centroids.set(i, book.nearest(v[0]), book.nearest(v[1]), book.nearest(v[2]), 255);
    }
    files_.at("shN_centroids.webp") = centroids.encoded(effort);
    store("shN_labels.webp", effort, [&](std::size_t i) {
      const std::uint32_t label = palette.labels[i];
      return std::array<std::uint8_t, 4>{static_cast<std::uint8_t>(label & 255),
                                         static_cast<std::uint8_t>(label >> 8), 0, 255};
    });
    nlohmann::json& meta = meta_.at("shN");
    meta["count"] = entries;
    meta["bands"] = cloud_.sh_degree;
    meta["codebook"] = book.values();
  }

  const GaussianCloud& cloud_;
  const StoredPositions positions_;
  ThreadPool& pool_;
  std::vector<std::uint32_t> order_;  // of the texels
  std::size_t width_ = 0, height_ = 0;
  nlohmann::json meta_;
  std::map<std::string, std::string> files_;
};

}  // namespace

std::vector<std::string> sog_losses(const GaussianCloud& cloud) {
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
  const StoredPositions points = stored_positions(cloud);
  for (const glm::vec3& m : points.mean()) {
    const glm::vec3 logarithm(glm::dvec3(log_mean(m.x), log_mean(m.y), log_mean(m.z)));
    low = glm::min(low, logarithm);
    high = glm::max(high, logarithm);
  }
  Losses losses(cloud);
  losses.moved(points.mean());
  losses.positions([steps = (high - low) / mean_steps](const glm::vec3& mean) {
    const glm::vec3 at = steps * (1.0f + glm::abs(mean));
    return std::max({at.x, at.y, at.z});
  });
  return std::move(losses).notes();
}

void write_sog(const GaussianCloud& cloud, ThreadPool& pool, std::ostream& to) {
  write_zip(Writer(cloud, pool).files(), to);
}

}  // namespace catgs
