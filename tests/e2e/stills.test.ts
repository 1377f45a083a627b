// Visitors see what catgs-render renders, after encoder, wire, decoder and canvas.
import { readdirSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { describe, expect, it } from 'vitest';
import { axis_angle, multiply } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { choose_full_size, keep_screenshot, open } from './support/browser';
import { pose_of, settle } from './support/camera';
import {
  coverage,
  mean_colour,
  psnr_db,
  read_png,
  settled_picture,
  type Picture,
} from './support/pictures';
import { catgs_render, start_server } from './support/programs';
import { scratch_folder, write_patches, write_tum } from './support/scenes';

const folder = scratch_folder();
const fov_y_rad = Math.PI / 3;
const size = [640, 360] as const;

/** A page with pictures of the size of its view. */
async function open_full_size(url: string): Promise<Page> {
  const { page } = await open(url);
  await choose_full_size(page);
  return page;
}

async function picture_at(page: Page, pose: Pose, fov: number): Promise<Picture> {
  await page.evaluate(([at, angle]) => window.catgs!.setPose(at, angle), [pose, fov] as const);
  return settled_picture(page);
}

describe('stills', () => {
  it('match the images of catgs-render', async () => {
    const scene = path.join(folder, 'city.ply');
    catgs_render('synth', 'city', scene, '--gaussians', '100000');
    const server = await start_server(scene);
    const page = await open_full_size(server.url);
    await page.mouse.move(size[0] / 2, size[1] / 2);
    await page.mouse.wheel(0, -800); // from the first sight of the whole city into it
    await settle(page);
    const start = await pose_of(page);
    const turned = (yaw: number, pitch: number): Pose => ({
      position: start.position,
      orientation: multiply(
        multiply(axis_angle([0, -1, 0], yaw), start.orientation),
        axis_angle([1, 0, 0], pitch),
      ),
    });
    const poses = [start, turned(0.3, -0.25), turned(-0.5, -0.3), turned(0, -0.5)];
    const trace = path.join(folder, 'poses.tum');
    const images = path.join(folder, 'images');
    write_tum(trace, poses);
    catgs_render(
      ...['frames', scene, '--trace', trace, '--out', images],
      ...['--size', size.join('x'), '--fov-deg', '60'],
    );
    const files = readdirSync(images).sort();
    expect(files).toHaveLength(poses.length);
    let judged = 0;
    for (const [i, pose] of poses.entries()) {
      const rendered = await read_png(page, path.join(images, files[i]!));
      const streamed = await picture_at(page, pose, fov_y_rad);
      await keep_screenshot(page, `still-${i}`);
      const covered = coverage(rendered);
      const psnr = psnr_db(rendered, streamed);
      console.log(`still ${i}: ${psnr.toFixed(2)} dB, ${(covered * 100).toFixed(0)} % covered`);
      if (covered < 0.7) continue;
      judged += 1;
      expect(psnr).toBeGreaterThanOrEqual(36);
    }
    expect(judged).toBeGreaterThanOrEqual(3);
  });
});

// Primaries, secondaries, greys and a skin tone. A wrong matrix or range moves at least one of them by
// far more than the bound.
const colours = [
  ...[
    [255, 0, 0],
    [0, 255, 0],
    [0, 0, 255],
    [0, 255, 255],
    [255, 0, 255],
    [255, 255, 0],
  ],
  ...[
    [255, 255, 255],
    [128, 128, 128],
    [32, 32, 32],
    [224, 172, 140],
    [96, 108, 32],
    [20, 120, 130],
  ],
] as [number, number, number][];
const columns = 4;
const spacing_px = 120; // between centres; a spot's standard deviation is a quarter of it

describe('colours', () => {
  const focal_px = size[1] / 2 / Math.tan(fov_y_rad / 2);
  const patches = colours.map((rgb, i) => {
    const x_px = ((i % columns) - (columns - 1) / 2) * spacing_px;
    const y_px = (Math.floor(i / columns) - 1) * spacing_px;
    return {
      rgb,
      x: x_px / focal_px,
      y: y_px / focal_px,
      x_px: size[0] / 2 + x_px,
      y_px: size[1] / 2 + y_px,
    };
  });

  it.each([
    ['H.264', 'x264'],
    ['JPEG', 'jpeg'],
  ])('are right in %s', async (name, encoder) => {
    const scene = path.join(folder, 'patches.ply');
    write_patches(scene, patches, 5, spacing_px / 4 / focal_px);
    const server = await start_server(scene, ['--encoder', encoder]);
    const page = await open_full_size(server.url);
    const origin: Pose = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
    const picture = await picture_at(page, origin, fov_y_rad);
    await keep_screenshot(page, `patches-${encoder}`);
    const errors = patches.map(({ rgb, x_px, y_px }) => {
      const seen = mean_colour(picture, x_px, y_px, 2);
      const error = Math.max(...seen.map((value, c) => Math.abs(value - rgb[c]!)));
      return { rgb, error, seen: seen.map((value) => value.toFixed(1)).join(' ') };
    });
    console.log(name, 'largest error', Math.max(...errors.map(({ error }) => error)).toFixed(1));
    expect(errors.filter(({ error }) => error > 3)).toEqual([]);
  });
});
