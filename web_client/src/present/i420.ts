// Converts BT.709 limited-range 4:2:0 to RGB, exact to the last bit but one. Browsers do this on a GPU.
// Chromium's conversion on a CPU misses saturated blue by 12/255: its coefficient 2.11 does not fit the
// eight bits it has there. So the 2D canvas gets its own conversion.

// Recommendation ITU-R BT.709: Kr = 0.2126, Kb = 0.0722; limited range: luma 16…235, chroma 16…240.
const luma_scale = 255 / 219;
const chroma_scale = 255 / 224;
const cr_to_r = 2 * (1 - 0.2126) * chroma_scale;
const cb_to_b = 2 * (1 - 0.0722) * chroma_scale;
const cr_to_g = (-cr_to_r * 0.2126) / 0.7152;
const cb_to_g = (-cb_to_b * 0.0722) / 0.7152;

const fraction_bits = 16;

/** Contribution of each 8-bit value to a channel, fixed point. */
function table(scale: number, zero: number, bias = 0): Int32Array {
  return Int32Array.from({ length: 256 }, (_, value) =>
    Math.round(((value - zero) * scale + bias) * 2 ** fraction_bits),
  );
}

const luma = table(luma_scale, 16, 0.5); // the bias rounds the sum
const r_of_cr = table(cr_to_r, 128);
const g_of_cr = table(cr_to_g, 128);
const g_of_cb = table(cb_to_g, 128);
const b_of_cb = table(cb_to_b, 128);

// Sums range from -290 to 550. A table clamps them without a branch.
const clamp_offset = 320;
const clamped = Uint8Array.from({ length: 1024 }, (_, i) =>
  Math.min(255, Math.max(0, i - clamp_offset)),
);

/** Offset of a plane in the buffer and bytes between its rows. */
export interface PlaneLayout {
  readonly offset: number;
  readonly stride: number;
}

/**
 * Converts the planes Y, Cb, Cr of `yuv` (8 bit, chroma at half size both ways) to `rgba`, one
 * 32-bit word per pixel, red in the lowest byte, opaque. Width and height are even.
 */
export function i420_to_rgba(
  yuv: Uint8Array,
  [y, cb, cr]: readonly [PlaneLayout, PlaneLayout, PlaneLayout],
  width: number,
  height: number,
  rgba: Uint32Array,
): void {
  const pixel = (sum_r: number, sum_g: number, sum_b: number): number =>
    clamped[(sum_r >> fraction_bits) + clamp_offset]! |
    (clamped[(sum_g >> fraction_bits) + clamp_offset]! << 8) |
    (clamped[(sum_b >> fraction_bits) + clamp_offset]! << 16) |
    0xff000000;
  for (let row = 0; row < height; row += 2) {
    let top = y.offset + row * y.stride;
    let bottom = top + y.stride;
    let u = cb.offset + (row >> 1) * cb.stride;
    let v = cr.offset + (row >> 1) * cr.stride;
    let out = row * width;
    for (const end = out + width; out < end; out += 2) {
      const blue = yuv[u++]!;
      const red = yuv[v++]!;
      const r = r_of_cr[red]!;
      const g = g_of_cr[red]! + g_of_cb[blue]!;
      const b = b_of_cb[blue]!;
      let l = luma[yuv[top++]!]!;
      rgba[out] = pixel(l + r, l + g, l + b);
      l = luma[yuv[top++]!]!;
      rgba[out + 1] = pixel(l + r, l + g, l + b);
      l = luma[yuv[bottom++]!]!;
      rgba[out + width] = pixel(l + r, l + g, l + b);
      l = luma[yuv[bottom++]!]!;
      rgba[out + width + 1] = pixel(l + r, l + g, l + b);
    }
  }
}
