#include <algorithm>
#include <vector>

#include "render_core/synth/city_ground.h"
#include "render_core/synth/city_parts.h"
#include "render_core/synth/shapes.h"

namespace catgs::synth {
namespace {

constexpr float zebra_start = 1.0f;  // from the crossing's edge
constexpr float zebra_width = 3.2f;
constexpr float stop_line_start = zebra_start + zebra_width + 0.75f;
constexpr float stop_line_end = stop_line_start + 0.45f;
constexpr float line_half_width = 0.09f;

/// White bars with asphalt between them, from kerb to kerb.
void paint_zebra(Painter& p, const Ground& s, float a0, float a1, float kerb, std::uint64_t index) {
  const int bars = static_cast<int>(std::floor(2.0f * kerb));
  const float pitch = 2.0f * kerb / static_cast<float>(bars);
  for (int i = 0; i < bars; ++i) {
    const float c = -kerb + pitch * static_cast<float>(i);
    const std::uint64_t key = index + 2 * static_cast<std::uint64_t>(i);
    paint_rectangle(p, s, a0, a1, c, c + pitch * 0.5f, s.asphalt(), 1.3 * road_density, key, 0.0f,
                    0.54f);
    paint_rectangle(p, s, a0, a1, c + pitch * 0.5f, c + pitch, s.line(), 1.3 * road_density,
                    key + 1, 0.0f, 0.56f);
  }
}

/// A strip of road with a line of dashes in it, or an unbroken one.
void paint_dashes(Painter& p, const Ground& s, float a0, float a1, float c, bool broken,
                  std::uint64_t index) {
  focus_on(p, s.patch(a0, a1, c - line_half_width, c + line_half_width));
  const int pieces = std::max(1, static_cast<int>(std::floor((a1 - a0) / 3.0f)));
  const float step = (a1 - a0) / static_cast<float>(pieces);
  for (int i = 0; i < pieces; ++i) {
    const float a = a0 + step * static_cast<float>(i);
    const bool white = !broken || i % 2 == 1;
    paint_patch(p, s.patch(a, a + step, c - line_half_width, c + line_half_width),
                white ? s.line() : s.asphalt(),
                (white ? 4.0 : 3.0) * std::min(1.0f, 0.3f + s.detail(a, c)),
                child(s.key, index + static_cast<std::uint64_t>(i)), 0.5f);
  }
}

/// One end of a street: a zebra crossing and the line where traffic stops before it.
void paint_street_end(Painter& p, const Ground& s, float kerb, bool far) {
  const std::uint64_t base = far ? 2000 : 1000;
  const auto stretch = [&](float from, float to, const auto& paint) {
    if (far) {
      paint(s.length - to, s.length - from);
    } else {
      paint(from, to);
    }
  };
  const auto asphalt = [&](std::uint64_t index) {
    return [&p, &s, kerb, index](float a, float b) {
      paint_rectangle(p, s, a, b, -kerb, kerb, s.asphalt(), road_density, index);
    };
  };
  stretch(0.0f, zebra_start, asphalt(base));
  stretch(zebra_start, zebra_start + zebra_width,
          [&](float a, float b) { paint_zebra(p, s, a, b, kerb, base + 10); });
  stretch(zebra_start + zebra_width, stop_line_start, asphalt(base + 1));
  stretch(stop_line_start, stop_line_end, [&](float a, float b) {
    // Traffic keeps to the right, so the line lies on the half that enters the crossing.
    const bool positive = far == s.along_x;
    paint_rectangle(p, s, a, b, positive ? 0.0f : -kerb, positive ? kerb : 0.0f, s.line(),
                    2.0 * road_density, base + 2, 0.0f, 0.5f);
    paint_rectangle(p, s, a, b, positive ? -kerb : 0.0f, positive ? 0.0f : kerb, s.asphalt(),
                    road_density, base + 3);
  });
}

void paint_carriageway(Painter& p, const Ground& s, float kerb) {
  paint_street_end(p, s, kerb, false);
  paint_street_end(p, s, kerb, true);
  const bool avenue = kerb > 6.0f;
  const float parking = kerb - 2.25f;
  const std::vector<float> lines = avenue ? std::vector<float>{-parking, -2.9f, 0.0f, 2.9f, parking}
                                          : std::vector<float>{-parking, 0.0f, parking};
  float from = -kerb;
  for (std::size_t i = 0; i <= lines.size(); ++i) {
    const float to = i < lines.size() ? lines[i] - line_half_width : kerb;
    paint_rectangle(p, s, stop_line_end, s.length - stop_line_end, from, to, s.asphalt(),
                    road_density, 300 + i, 0.0f, 0.54f);
    if (i < lines.size()) {
      const bool unbroken = avenue && lines[i] == 0.0f;
      paint_dashes(p, s, stop_line_end, s.length - stop_line_end, lines[i], !unbroken,
                   400 + 100 * i);
      from = lines[i] + line_half_width;
    }
  }
}

void paint_kerb(Painter& p, const Ground& s, float c, std::uint64_t index) {
  Finish stone = s.paving(0.75f);
  stone.albedo = {0.50f, 0.47f, 0.42f};
  const int pieces = std::max(1, static_cast<int>(std::floor(s.length / 8.0f)));
  const float step = s.length / static_cast<float>(pieces);
  for (int i = 0; i < pieces; ++i) {
    const float a = step * static_cast<float>(i);
    focus_on(p, s.patch(a, a + step, c - 0.12f, c + 0.12f));
    paint_line(p, s.point(a, c, 0.6f * kerb_height), s.point(a + step, c, 0.6f * kerb_height),
               0.24f, stone, 2.2 * step * s.detail(a, c),
               child(s.key, index + static_cast<std::uint64_t>(i)));
  }
}

void paint_street(Painter& p, const Ground& s) {
  const float pavement = pavement_width(s.width);
  const float kerb = s.width * 0.5f - pavement;
  paint_carriageway(p, s, kerb);
  constexpr float dim_strip = 0.9f;  // along the walls, which hide half the sky
  paint_rectangle(p, s, 0, s.length, -kerb - pavement, -kerb - pavement + dim_strip, s.paving(0.5f),
                  pavement_density, 20, kerb_height);
  paint_rectangle(p, s, 0, s.length, -kerb - pavement + dim_strip, -kerb, s.paving(0.74f),
                  pavement_density, 21, kerb_height);
  paint_rectangle(p, s, 0, s.length, kerb, kerb + pavement - dim_strip, s.paving(0.74f),
                  pavement_density, 22, kerb_height);
  paint_rectangle(p, s, 0, s.length, kerb + pavement - dim_strip, kerb + pavement, s.paving(0.5f),
                  pavement_density, 23, kerb_height);
  paint_kerb(p, s, -kerb, 3000);
  paint_kerb(p, s, kerb, 3100);
}

/// Asphalt between the kerbs, pavement in the corners.
void paint_crossing(Painter& p, const Ground& s, float width_x, float width_z) {
  const float kerb_x = 0.5f * width_x - pavement_width(width_x);
  const float kerb_z = 0.5f * width_z - pavement_width(width_z);
  paint_rectangle(p, s, -0.5f * width_x, 0.5f * width_x, -kerb_z, kerb_z, s.asphalt(), road_density,
                  1);
  for (const bool north : {false, true}) {
    const float c0 = north ? kerb_z : -0.5f * width_z;
    const float c1 = north ? 0.5f * width_z : -kerb_z;
    const std::uint64_t index = north ? 2 : 12;
    paint_rectangle(p, s, -kerb_x, kerb_x, c0, c1, s.asphalt(), road_density, index);
    paint_rectangle(p, s, -0.5f * width_x, -kerb_x, c0, c1, s.paving(0.75f), pavement_density,
                    index + 1, kerb_height);
    paint_rectangle(p, s, kerb_x, 0.5f * width_x, c0, c1, s.paving(0.75f), pavement_density,
                    index + 2, kerb_height);
  }
}

}  // namespace

void paint_streets(Painter& painter, const Block& block, float haze) {
  const float x = block_pitch_m * static_cast<float>(block.column);
  const float z = block_pitch_m * static_cast<float>(block.row);
  const float west = street_width_x(block.column), south = street_width_z(block.row);
  const float east = street_width_x(block.column + 1), north = street_width_z(block.row + 1);
  const float length_z = block_pitch_m - 0.5f * (south + north);
  const float length_x = block_pitch_m - 0.5f * (west + east);
  paint_street(painter, {{x, z + 0.5f * south}, false, length_z, west, haze, child(block.key, 60)});
  paint_street(painter, {{x + 0.5f * west, z}, true, length_x, south, haze, child(block.key, 61)});
  paint_crossing(painter, {{x, z}, true, 0.0f, 0.0f, haze, child(block.key, 62)}, west, south);
}

}  // namespace catgs::synth
