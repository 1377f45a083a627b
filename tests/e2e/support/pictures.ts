// Pixels of the shown picture and of PNG files, and measures of their difference.
import { readFileSync } from 'node:fs';
import type { Page } from 'playwright-core';

export interface Picture {
  readonly width: number;
  readonly height: number;
  readonly rgba: Uint8Array | Uint8ClampedArray;
}

/** The picture that the page shows, once it has come to rest. */
export const settled_picture = (page: Page): Promise<Picture> =>
  page.evaluate(async () => {
    const { catgs } = window;
    if (!catgs) throw new Error('the page has no window.catgs');
    await catgs.settled();
    const { width_px, height_px, rgba } = await catgs.snapshot();
    return { width: width_px, height: height_px, rgba };
  });

/** `page` may be any page: only its decoder is used. */
export const read_png = (page: Page, file: string): Promise<Picture> =>
  page.evaluate(
    async (png) => {
      const bitmap = await createImageBitmap(new Blob([png], { type: 'image/png' }), {
        colorSpaceConversion: 'none',
      });
      const { width, height } = bitmap;
      const context = new OffscreenCanvas(width, height).getContext('2d')!;
      context.drawImage(bitmap, 0, 0);
      return { width, height, rgba: context.getImageData(0, 0, width, height).data };
    },
    new Uint8Array(readFileSync(file)),
  );

/** PSNR over the RGB values of all pixels. */
export function psnr_db(a: Picture, b: Picture): number {
  if (a.width !== b.width || a.height !== b.height) {
    throw new Error(`${a.width}x${a.height} against ${b.width}x${b.height}`);
  }
  let sum = 0;
  for (let i = 0; i < a.rgba.length; ++i) {
    if (i % 4 !== 3) sum += (a.rgba[i]! - b.rgba[i]!) ** 2;
  }
  const mean = sum / (a.width * a.height * 3);
  return 10 * Math.log10(255 ** 2 / mean);
}

/** Means of 32x18 boxes, to compare pictures of different sizes, which a busy server sends. */
export function thumbnail({ width, height, rgba }: Picture): Picture {
  const columns = 32;
  const rows = 18;
  const sums = new Float64Array(columns * rows * 4);
  const counts = new Uint32Array(columns * rows);
  for (let y = 0; y < height; ++y) {
    for (let x = 0; x < width; ++x) {
      const box = Math.floor((y * rows) / height) * columns + Math.floor((x * columns) / width);
      counts[box]! += 1;
      for (let c = 0; c < 4; ++c) sums[4 * box + c]! += rgba[4 * (y * width + x) + c]!;
    }
  }
  return {
    width: columns,
    height: rows,
    rgba: Uint8Array.from(sums, (sum, i) => Math.round(sum / counts[i >> 2]!)),
  };
}

/** Share of the pixels that are not the black background. */
export function coverage(picture: Picture): number {
  let covered = 0;
  for (let i = 0; i < picture.rgba.length; i += 4) {
    if (Math.max(picture.rgba[i]!, picture.rgba[i + 1]!, picture.rgba[i + 2]!) > 8) covered += 1;
  }
  return covered / (picture.width * picture.height);
}

/** Mean colour of the square of side 2 * radius + 1 around a pixel. */
export function mean_colour(
  picture: Picture,
  x: number,
  y: number,
  radius: number,
): [number, number, number] {
  const sum: [number, number, number] = [0, 0, 0];
  for (let row = y - radius; row <= y + radius; ++row) {
    for (let column = x - radius; column <= x + radius; ++column) {
      const at = (row * picture.width + column) * 4;
      for (const c of [0, 1, 2] as const) sum[c] += picture.rgba[at + c]!;
    }
  }
  const count = (2 * radius + 1) ** 2;
  return [sum[0] / count, sum[1] / count, sum[2] / count];
}
