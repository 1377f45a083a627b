import { describe, expect, it } from 'vitest';
import { i420_to_rgba } from '#client/present/i420';

const width = 4;
const height = 2;
const layout = [
  { offset: 0, stride: 6 },
  { offset: 12, stride: 3 },
  { offset: 15, stride: 3 },
] as const;

/** BT.709 with limited range, straight from its definition. */
function expected(y: number, cb: number, cr: number): number[] {
  const l = (y - 16) / 219;
  const b = l + (2 * (1 - 0.0722) * (cb - 128)) / 224;
  const r = l + (2 * (1 - 0.2126) * (cr - 128)) / 224;
  const g = (l - 0.2126 * r - 0.0722 * b) / 0.7152;
  return [r, g, b].map((v) => Math.round(255 * Math.min(1, Math.max(0, v))));
}

function convert(y: number[][], cb: number[], cr: number[]): number[][] {
  const yuv = new Uint8Array(18);
  y.forEach((row, i) => yuv.set(row, i * 6));
  yuv.set(cb, 12);
  yuv.set(cr, 15);
  const rgba = new Uint32Array(width * height);
  i420_to_rgba(yuv, layout, width, height, rgba);
  const bytes = new Uint8Array(rgba.buffer);
  return Array.from(rgba, (_, i) => [...bytes.subarray(i * 4, i * 4 + 4)]);
}

describe('software colour conversion', () => {
  it('puts every sample where it belongs', () => {
    const y = [
      [16, 50, 90, 130],
      [170, 200, 235, 60],
    ];
    const pixels = convert(y, [90, 200], [240, 30]);
    for (let row = 0; row < height; ++row) {
      for (let column = 0; column < width; ++column) {
        const chroma = column >> 1;
        const [r, g, b] = expected(y[row]![column]!, [90, 200][chroma]!, [240, 30][chroma]!);
        expect(pixels[row * width + column]).toEqual([r, g, b, 255]);
      }
    }
  });

  it('is within one step of the definition for all values', () => {
    // There is one expectation at the end, because thousands of them take seconds.
    let worst = { error: 0, at: '' };
    for (let y = 0; y < 256; y += 5) {
      for (let cb = 0; cb < 256; cb += 15) {
        for (let cr = 0; cr < 256; cr += 15) {
          const [pixel] = convert([[y, y, y, y]], [cb, cb], [cr, cr]);
          const truth = expected(y, cb, cr);
          const error = Math.max(...truth.map((v, c) => Math.abs(v - pixel![c]!)));
          if (error > worst.error) worst = { error, at: `${y} ${cb} ${cr}` };
        }
      }
    }
    expect(worst.error, worst.at).toBeLessThanOrEqual(1);
  });
});
