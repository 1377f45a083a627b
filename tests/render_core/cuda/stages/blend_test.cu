// Blending, against the CPU core's kernel on the same splats and lists; folding slices, against the
// formulas on the host.

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "render_core/cuda/split.cuh"
#include "render_core/math/ellipse-inl.h"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

constexpr glm::ivec2 size_px{90, 60};  // parts of the last tiles lie outside
constexpr glm::vec3 background(0.2f, 0.5f, 0.1f);

/// Splats on a picture, nearest first, and the list of each tile: those that reach one of its
/// pixels.
class BlendStage : public StageTest {
 protected:
  BlendStage() : shape_(picture_shape(size_px)) {
    std::mt19937_64 random(31);
    const auto uniform = [&](double low, double high) {
      return static_cast<float>(low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53);
    };
    for (std::uint32_t i = 0; i < 1500; ++i) {
      catgs::Splat s{};
      s.centre_x = uniform(-10, 100);
      s.centre_y = uniform(-10, 70);
      s.whitening_xx = 1.0f / uniform(0.6, 9.0);
      s.whitening_yy = 1.0f / uniform(0.6, 9.0);
      s.whitening_xy = uniform(-0.5, 0.5) * std::min(s.whitening_xx, s.whitening_yy);
      s.log2_opacity = std::log2(uniform(0.01, 0.6));
      // What halves hold as it is.
      s.red = static_cast<float>(random() % 129) / 128.0f;
      s.green = static_cast<float>(random() % 129) / 128.0f;
      s.blue = static_cast<float>(random() % 129) / 128.0f;
      s.scene_order = i;
      s.depth = static_cast<float>(i);
      splats_.push_back(s);
      SplatRecord record{};
      record.centre_px = make_float2(s.centre_x, s.centre_y);
      record.whitening = {s.whitening_xx, s.whitening_xy, s.whitening_yy};
      record.log2_opacity = s.log2_opacity;
      record.colour = {__floats2half2_rn(s.red, s.green), __float2half_rn(s.blue),
                       __float2half_rn(0.0f)};
      records_.push_back(record);
    }
    for (std::uint32_t t = 0; t < shape_.tiles(); ++t) {
      const auto first = static_cast<std::uint32_t>(entries_.size());
      for (std::uint32_t i = 0; i < splats_.size(); ++i)
        if (const std::uint32_t blocks = reached(splats_[i], t); blocks != 0)
          entries_.push_back({i, blocks});
      ranges_.push_back(make_uint2(first, static_cast<std::uint32_t>(entries_.size())));
    }
    shape_.list_bound = static_cast<std::uint32_t>(entries_.size());
  }

  [[nodiscard]] glm::ivec2 corner_of(std::uint32_t tile) const {
    return tile_side_px * glm::ivec2(static_cast<int>(tile) % shape_.tiles_x,
                                     static_cast<int>(tile) / shape_.tiles_x);
  }

  /// The blocks of a tile that a splat reaches.
  [[nodiscard]] std::uint32_t reached(const catgs::Splat& s, std::uint32_t tile) const {
    const math::Whitening<double> w{s.whitening_xx, s.whitening_xy, s.whitening_yy};
    const glm::ivec2 corner = corner_of(tile);
    std::uint32_t blocks = 0;
    for (int y = 0; y < tile_side_px; ++y)
      for (int x = 0; x < tile_side_px; ++x)
        if (s.log2_opacity - math::whitened_square<double>(w, {corner.x + x + 0.5 - s.centre_x,
                                                               corner.y + y + 0.5 - s.centre_y}) >=
            log2_alpha_min)
          blocks |= 1u << (y / block_height_px * blocks_across + x / block_width_px);
    return blocks;
  }

  /// Blends the pixels of the CPU core's tile at `corner`. Returns how many entries it looked at.
  std::size_t blend_on_cpu(const std::vector<DepthSlot>& list, glm::ivec2 corner,
                           HostImage& image) const {
    std::array<float, blocks_per_tile> ends{};
    (void)simd_kernels().front().blend_tile({.splats = splats_.data(),
                                             .list = list,
                                             .first_px = corner,
                                             .background = background,
                                             .cull_blocks = true,
                                             .fills = false,
                                             .count_pairs = false,
                                             .image = &image,
                                             .ends = {ends.data(), catgs::parts_across},
                                             .depths = {}});
    const float end = *std::ranges::max_element(ends);
    if (std::isinf(end)) return list.size();
    const auto behind = std::ranges::find_if(
        list, [&](const DepthSlot& entry) { return splats_[entry.value].depth > end; });
    return static_cast<std::size_t>(behind - list.begin());
  }

  /// The CPU core's picture; `looked_at`: entries of each tile's list.
  std::vector<float> on_cpu(std::vector<std::size_t>& looked_at) const {
    HostImage image;
    image.resize(PixelFormat::rgb_f32, size_px);
    for (std::uint32_t t = 0; t < shape_.tiles(); ++t) {
      std::vector<DepthSlot> list;
      for (std::uint32_t k = ranges_[t].x; k < ranges_[t].y; ++k)
        list.push_back({k, entries_[k].slot});
      const glm::ivec2 corner = corner_of(t), end = glm::min(corner + tile_side_px, size_px);
      std::size_t most = 0;
      // The CPU core's tiles are smaller.
      for (int y = corner.y; y < end.y; y += tile_size_px)
        for (int x = corner.x; x < end.x; x += tile_size_px)
          most = std::max(most, blend_on_cpu(list, {x, y}, image));
      looked_at.push_back(most);
    }
    std::vector<float> rgb;
    for (int y = 0; y < size_px.y; ++y)
      rgb.insert(rgb.end(), image.rgb_row(y), image.rgb_row(y) + 3 * size_px.x);
    return rgb;
  }

  /// Tasks and their queue: whole tiles first, then slices.
  struct Tasks {
    std::vector<BlendTask> tasks;  // one a tile, then one a slice
    std::vector<uint2> of_tile;    // first slice, count
    std::vector<std::uint32_t> queue;
    FrameCounts counts;
  };
  /// Tiles in slices of `slice` entries; 0: each in one task.
  Tasks cut(std::uint32_t slice) {
    const std::uint32_t tiles = shape_.tiles();
    Tasks cut;
    for (std::uint32_t t = 0; t < tiles; ++t)
      cut.tasks.push_back({t, ranges_[t].x, ranges_[t].y, 0, 1});
    std::vector<std::uint32_t> whole, sliced;
    for (std::uint32_t t = 0; t < tiles; ++t) {
      const auto first = static_cast<std::uint32_t>(cut.tasks.size()) - tiles;
      const std::uint32_t listed = ranges_[t].y - ranges_[t].x;
      const std::uint32_t slices = slice == 0 ? 1 : (listed + slice - 1) / slice;
      cut.of_tile.push_back(make_uint2(first, slices > 1 ? slices : 0));
      if (slices <= 1) {
        whole.push_back(t);
        continue;
      }
      for (std::uint32_t s = 0; s < slices; ++s) {
        const std::uint32_t begin = ranges_[t].x + s * slice;
        sliced.push_back(static_cast<std::uint32_t>(cut.tasks.size()));
        cut.tasks.push_back({t, begin, std::min(begin + slice, ranges_[t].y),
                             static_cast<std::uint16_t>(s), static_cast<std::uint16_t>(slices)});
      }
    }
    shape_.slice_bound = static_cast<std::uint32_t>(cut.tasks.size()) - tiles;
    cut.queue = whole;
    cut.queue.resize((queue_classes - 1) * tiles);
    cut.queue.insert(cut.queue.end(), sliced.begin(), sliced.end());
    cut.counts.queued[0] = static_cast<std::uint32_t>(whole.size());
    cut.counts.queued[queue_classes - 1] = static_cast<std::uint32_t>(sliced.size());
    return cut;
  }

  /// The device's picture, blended in the tasks of cut(slice), and where its parts end.
  std::vector<float> on_device(const Finish& finish, std::vector<std::uint32_t>& reached,
                               std::vector<float>& ends, std::uint32_t slice = 0) {
    const std::uint32_t tiles = shape_.tiles();
    const Tasks cut = this->cut(slice);
    const std::size_t slices = shape_.slice_bound;
    const auto record = upload(records_);
    const auto entry = upload(entries_);
    const auto queue = upload(cut.queue);
    const auto reach = upload(std::vector<std::uint32_t>(tiles));
    const auto task = upload(cut.tasks);
    const auto of_tile = upload(cut.of_tile);
    const auto on_device = upload(std::vector{cut.counts});
    const auto pixels = upload(std::vector<float4>(slices * tile_pixels));
    const auto consumed = upload(std::vector<std::uint32_t>(slices * parts_per_tile));
    const auto transmittance = upload(std::vector<float>(slices * parts_per_tile, 1.0f));
    const auto rgb =
        upload(std::vector<float>(3 * static_cast<std::size_t>(size_px.x * size_px.y), -1.0f));
    std::vector<float> depths;  // a splat's depth is its number
    for (std::size_t i = 0; i < splats_.size(); ++i) depths.push_back(static_cast<float>(i));
    const auto depth = upload(depths);
    const auto end = upload(std::vector<float>(std::size_t{tiles} * parts_per_tile, -1.0f));
    const PartEnds part_ends{.splat_depth = depth.get(), .depth = end.get()};
    const float3 behind = make_float3(background.x, background.y, background.z);
    const Stream stream;
    launch_blend({.shape = shape_,
                  .records = record.get(),
                  .entries = entry.get(),
                  .tasks = task.get(),
                  .queue = queue.get(),
                  .background = behind,
                  .rgb = rgb.get(),
                  .slice_pixels = pixels.get(),
                  .consumed = consumed.get(),
                  .slice_transmittance = transmittance.get(),
                  .ends = part_ends,
                  .finish = finish,
                  .reach = reach.get(),
                  .counts = on_device.get(),
                  .loose = false,
                  .count_pairs = false,
                  .warps = blend_warps(processors())},
                 stream.get());
    launch_composite({.shape = shape_,
                      .tasks = task.get(),
                      .tile_slices = of_tile.get(),
                      .slice_pixels = pixels.get(),
                      .consumed = consumed.get(),
                      .entries = entry.get(),
                      .ends = part_ends,
                      .loose = false,
                      .finish = finish,
                      .background = behind,
                      .rgb = rgb.get(),
                      .reach = reach.get()},
                     stream.get());
    reached = fetch(reach.get(), tiles);
    ends = fetch(end.get(), std::size_t{tiles} * parts_per_tile);
    return fetch(rgb.get(), rgb.size());
  }

  FrameShape shape_;
  std::vector<catgs::Splat> splats_;
  std::vector<SplatRecord> records_;
  std::vector<TileEntry> entries_;
  std::vector<uint2> ranges_;
};

constexpr Finish exact_finish{.transmittance = static_cast<float>(transmittance_min),
                              .fills = false};

TEST_F(BlendStage, IsTheCpuCoresButForTheRestOfARound) {
  std::vector<std::size_t> looked_at;
  const std::vector<float> expected = on_cpu(looked_at);
  std::vector<std::uint32_t> reached;
  std::vector<float> ends;
  const std::vector<float> drawn = on_device(exact_finish, reached, ends);
  // A finished pixel sees at most transmittance_min / (1 - alpha_max) of what lies behind it.
  Difference colour("blend: colour", 0.0101);
  for (std::size_t i = 0; i < drawn.size(); ++i) colour.add(drawn[i] - expected[i]);
  Difference quality("blend: dB below 60", 0.0);
  quality.add(std::max(0.0, 60.0 - catgs::test::psnr_db(drawn, expected)));
  Mismatches reach("blend: tiles that looked at less of their list", 0.05);
  for (std::size_t t = 0; t < looked_at.size(); ++t) {
    EXPECT_LE(reached[t], ranges_[t].y - ranges_[t].x);
    reach.add(reached[t] + 64 < looked_at[t]);
  }
}

TEST_F(BlendStage, SlicesFoldToTheWhole) {
  std::vector<std::uint32_t> reached, reached_in_slices;
  std::vector<float> ends;
  const std::vector<float> whole = on_device(exact_finish, reached, ends);
  for (const std::uint32_t slice : {1u, 40u, 150u}) {
    SCOPED_TRACE(slice);
    const std::vector<float> folded = on_device(exact_finish, reached_in_slices, ends, slice);
    ASSERT_GT(shape_.slice_bound, shape_.tiles());
    Difference colour("blend: colour of folded slices", 0.0101);
    for (std::size_t i = 0; i < whole.size(); ++i) colour.add(folded[i] - whole[i]);
    Difference quality("blend: dB below 60, of folded slices", 0.0);
    quality.add(std::max(0.0, 60.0 - catgs::test::psnr_db(folded, whole)));
    for (std::size_t t = 0; t < reached.size(); ++t)
      EXPECT_LE(reached_in_slices[t], ranges_[t].y - ranges_[t].x);
  }
}

class BlendEnds : public BlendStage, public testing::WithParamInterface<std::uint32_t> {};

// Splats behind the end of a part show nowhere in it. The parameter is the length of slices.
TEST_P(BlendEnds, PartsEndBehindWhatShows) {
  const Finish early{.transmittance = 0.05f, .fills = false};
  std::vector<std::uint32_t> reached;
  std::vector<float> ends;
  const std::vector<float> drawn = on_device(early, reached, ends, GetParam());
  std::size_t finished = 0, open = 0;
  std::vector<TileEntry> kept = entries_;
  for (std::uint32_t t = 0; t < shape_.tiles(); ++t) {
    for (int part = 0; part < parts_per_tile; ++part) {
      const glm::ivec2 at =
          corner_of(t) + part_side_px * glm::ivec2(part % parts_across, part / parts_across);
      if (at.x >= size_px.x || at.y >= size_px.y) continue;
      const float end = ends[t * parts_per_tile + static_cast<unsigned>(part)];
      (std::isinf(end) ? open : finished) += 1;
      for (std::uint32_t k = ranges_[t].x; k < ranges_[t].y; ++k)
        if (static_cast<float>(entries_[k].slot) > end) kept[k].blocks &= ~blocks_of(part);
    }
  }
  EXPECT_GT(finished, 10u);
  entries_ = kept;
  const std::vector<float> without = on_device(early, reached, ends, GetParam());
  Difference colour("blend: colour without what is behind the ends", 1e-6);
  for (std::size_t i = 0; i < drawn.size(); ++i) colour.add(drawn[i] - without[i]);
}

INSTANTIATE_TEST_SUITE_P(Slices, BlendEnds, testing::Values(0u, 200u));

TEST_F(BlendStage, FinishedPixelsFillTheRestWithTheirColour) {
  std::vector<std::uint32_t> reached;
  std::vector<float> ends;
  const Finish dark{.transmittance = 0.05f, .fills = false};
  const Finish filled{.transmittance = 0.05f, .fills = true};
  const std::vector<float> exact = on_device(exact_finish, reached, ends);
  const std::vector<float> a = on_device(dark, reached, ends);
  const std::vector<float> b = on_device(filled, reached, ends);
  // Splats behind are as bright as those in front, on average.
  EXPECT_GT(catgs::test::psnr_db(b, exact), catgs::test::psnr_db(a, exact));
  EXPECT_GT(catgs::test::psnr_db(b, exact), 35.0);
}

class CompositeStage : public StageTest {
 protected:
  /// What the blend leaves behind: slices of tiles, and how far each part of one looked.
  struct Slices {
    std::vector<uint2> of_tile;    // first slice, count
    std::vector<BlendTask> tasks;  // one a tile, then one a slice
    std::vector<float4> pixels;    // colour, transmittance; negative: the pixel is finished
    std::vector<std::uint32_t> looked_at;
  };
  static Slices random_slices(std::uint32_t tiles) {
    std::mt19937_64 random(41);
    const auto uniform = [&] { return static_cast<float>(random() >> 40) * 0x1p-24f; };
    Slices made;
    made.tasks.resize(tiles);
    std::uint32_t slices = 0;
    for (std::uint32_t t = 0; t < tiles; ++t) {
      const auto count = t % 5 == 1 ? 0u : 2u + static_cast<std::uint32_t>(random() % 6);
      made.of_tile.push_back(make_uint2(slices, count));
      for (std::uint32_t s = 0; s < count; ++s)
        made.tasks.push_back({t, 1000 * t + 100 * s, 1000 * t + 100 * (s + 1),
                              static_cast<std::uint16_t>(s), static_cast<std::uint16_t>(count)});
      slices += count;
    }
    for (std::uint32_t s = 0; s < slices; ++s) {
      for (int k = 0; k < tile_pixels; ++k) {
        const bool finished = random() % 4 == 0;
        const float transmittance = finished ? -0.001f : 0.05f + 0.9f * uniform();
        made.pixels.push_back(make_float4(uniform(), uniform(), uniform(), transmittance));
      }
      for (int part = 0; part < parts_per_tile; ++part)
        made.looked_at.push_back(made.tasks[tiles + s].first +
                                 static_cast<std::uint32_t>(random() % 100));
    }
    return made;
  }
};

TEST_F(CompositeStage, FoldsSlicesFrontToBack) {
  FrameShape shape = picture_shape(size_px);
  const std::uint32_t tiles = shape.tiles();
  const auto [of_tile, tasks, of_slice, looked_at] = random_slices(tiles);
  shape.slice_bound = static_cast<std::uint32_t>(tasks.size()) - tiles;
  const auto slice = upload(of_tile);
  const auto task = upload(tasks);
  const auto pixels = upload(of_slice);
  const auto consumed = upload(looked_at);
  const auto reach = upload(std::vector<std::uint32_t>(tiles));
  const auto rgb =
      upload(std::vector<float>(3 * static_cast<std::size_t>(size_px.x * size_px.y), -1.0f));
  const Stream stream;
  launch_composite({.shape = shape,
                    .tasks = task.get(),
                    .tile_slices = slice.get(),
                    .slice_pixels = pixels.get(),
                    .consumed = consumed.get(),
                    .entries = nullptr,
                    .ends = {.splat_depth = nullptr, .depth = nullptr},
                    .loose = false,
                    .finish = exact_finish,
                    .background = make_float3(background.x, background.y, background.z),
                    .rgb = rgb.get(),
                    .reach = reach.get()},
                   stream.get());
  const std::vector<float> drawn = fetch(rgb.get(), rgb.size());
  const std::vector<std::uint32_t> reached = fetch(reach.get(), tiles);

  Difference colour("composite: colour", 1e-5);
  Mismatches reaches("composite: reach of tiles", 0.0);
  for (std::uint32_t t = 0; t < tiles; ++t) {
    std::uint32_t farthest = 0;
    for (int k = 0; k < tile_pixels; ++k) {
      const int part = k / part_pixels, in_part = k % part_pixels;
      const int x = static_cast<int>(t) % shape.tiles_x * tile_side_px +
                    part % parts_across * part_side_px + in_part % part_side_px;
      const int y = static_cast<int>(t) / shape.tiles_x * tile_side_px +
                    part / parts_across * part_side_px + in_part / part_side_px;
      if (x >= size_px.x || y >= size_px.y) continue;
      glm::dvec3 sum(0.0);
      double transmittance = 1.0;
      for (std::uint32_t s = of_tile[t].x; s < of_tile[t].x + of_tile[t].y; ++s) {
        const float4& p = of_slice[std::size_t{s} * tile_pixels + static_cast<unsigned>(k)];
        sum += transmittance * glm::dvec3(p.x, p.y, p.z);
        transmittance *= std::abs(p.w);
        farthest = std::max(farthest, looked_at[s * parts_per_tile + static_cast<unsigned>(part)]);
        if (std::signbit(p.w) || transmittance < transmittance_min) break;
      }
      const float* pixel = &drawn[3 * static_cast<std::size_t>(y * size_px.x + x)];
      for (int c = 0; c < 3; ++c)
        colour.add(of_tile[t].y == 0
                       ? pixel[c] + 1.0f  // nothing was written
                       : pixel[c] - std::clamp(sum[c] + transmittance * background[c], 0.0, 1.0));
    }
    reaches.add(reached[t] !=
                (of_tile[t].y == 0 ? 0u : farthest - tasks[tiles + of_tile[t].x].first));
  }
}

}  // namespace
}  // namespace catgs::cuda::stages
