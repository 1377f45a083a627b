#include "server/encode/jpeg_color.h"

#include <algorithm>
#include <array>

#include "render_core/math/colour-inl.h"

namespace catgs {

namespace {

/// Luma weights of red and blue; green has the rest.
struct LumaWeights {
  double red;
  double blue;
};
constexpr LumaWeights bt709 = {math::luma_red, math::luma_blue};
constexpr LumaWeights bt601 = {0.299, 0.114};  // ITU-R BT.601-7, item 2.5.1

// With E' = (R', G', B') in 0…1: Y = Kr R + Kg G + Kb B, Cb = (B - Y) / (2 (1 - Kb)),
// Cr = (R - Y) / (2 (1 - Kr)); limited range codes Y as 16 + 219 Y and Cb, Cr as 128 + 224 C, full
// range as 255 Y and 128 + 255 C. Grey stays grey between two such systems, so the new chroma
// depends on the old chroma alone, and the new luma is the old luma plus a chroma term:
//   B - Y and R - Y of the old give G - Y; the new luma is Y + sum of new weights x (E' - Y).
struct Transform {
  double luma, luma_cb, luma_cr;  // full-range luma per limited code of Y - 16, Cb - 128, Cr - 128
  double cb_cb, cb_cr, cr_cb, cr_cr;
};

constexpr Transform derive(LumaWeights from, LumaWeights to) {
  const double from_green = 1 - from.red - from.blue;
  const double to_green = 1 - to.red - to.blue;
  // (E' - Y) per unit of the old Cb and Cr.
  const double blue_cb = 2 * (1 - from.blue);
  const double red_cr = 2 * (1 - from.red);
  const double green_cb = -from.blue * blue_cb / from_green;
  const double green_cr = -from.red * red_cr / from_green;
  // New Y - old Y per unit of the old Cb and Cr.
  const double shift_cb = to.blue * blue_cb + to_green * green_cb;
  const double shift_cr = to.red * red_cr + to_green * green_cr;
  const double to_full_y = 255.0 / 219.0;
  const double to_full_c = 255.0 / 224.0;
  const double new_cb = 2 * (1 - to.blue);
  const double new_cr = 2 * (1 - to.red);
  return {to_full_y,
          to_full_c * shift_cb,
          to_full_c * shift_cr,
          to_full_c * (blue_cb - shift_cb) / new_cb,
          to_full_c * -shift_cr / new_cb,
          to_full_c * -shift_cb / new_cr,
          to_full_c * (red_cr - shift_cr) / new_cr};
}
constexpr Transform transform = derive(bt709, bt601);

constexpr int fraction_bits = 16;
constexpr int one_half = 1 << (fraction_bits - 1);

constexpr int fixed(double value) {
  const double scaled = value * (1 << fraction_bits);
  return static_cast<int>(scaled < 0 ? scaled - 0.5 : scaled + 0.5);
}

std::uint8_t to_byte(int fixed_point) {
  return static_cast<std::uint8_t>(std::clamp(fixed_point >> fraction_bits, 0, 255));
}

/// One row of chroma; `luma_shift` gets what the two luma rows beside it need per 2x2 block.
void convert_chroma_row(const std::uint8_t* cb, const std::uint8_t* cr, std::uint8_t* cb_out,
                        std::uint8_t* cr_out, int* luma_shift, int blocks) {
  constexpr int neutral = (128 << fraction_bits) + one_half;
  for (int x = 0; x < blocks; ++x) {
    const int b = cb[x] - 128;
    const int r = cr[x] - 128;
    cb_out[x] = to_byte(neutral + fixed(transform.cb_cb) * b + fixed(transform.cb_cr) * r);
    cr_out[x] = to_byte(neutral + fixed(transform.cr_cb) * b + fixed(transform.cr_cr) * r);
    luma_shift[x] = one_half + fixed(transform.luma_cb) * b + fixed(transform.luma_cr) * r;
  }
}

void convert_luma_row(const std::uint8_t* luma, std::uint8_t* out, const int* luma_shift,
                      int blocks) {
  for (int x = 0; x < blocks; ++x) {
    out[2 * x] = to_byte(fixed(transform.luma) * (luma[2 * x] - 16) + luma_shift[x]);
    out[2 * x + 1] = to_byte(fixed(transform.luma) * (luma[2 * x + 1] - 16) + luma_shift[x]);
  }
}

}  // namespace

void video_to_jfif(const Yuv420Planes& video, const Yuv420Planes& jfif, glm::ivec2 size_px) {
  constexpr int strip = 512;  // blocks at a time: the shifts stay in the first-level cache
  std::array<int, strip> luma_shift;
  const int blocks = size_px.x / 2;
  for (int row = 0; row < size_px.y / 2; ++row) {
    const auto at = [row](const Yuv420Planes& planes, int plane, int rows_per_row = 1) {
      return planes.data[plane] + planes.stride_bytes[plane] * row * rows_per_row;
    };
    for (int x = 0; x < blocks; x += strip) {
      const int count = std::min(strip, blocks - x);
      convert_chroma_row(at(video, 1) + x, at(video, 2) + x, at(jfif, 1) + x, at(jfif, 2) + x,
                         luma_shift.data(), count);
      for (int line = 0; line < 2; ++line) {
        convert_luma_row(at(video, 0, 2) + line * video.stride_bytes[0] + 2 * x,
                         at(jfif, 0, 2) + line * jfif.stride_bytes[0] + 2 * x, luma_shift.data(),
                         count);
      }
    }
  }
}

}  // namespace catgs
