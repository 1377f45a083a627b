// Checks that things are where they belong while the camera walks over a slow link. It compares the canvas
// with what catgs-render draws for the camera of that moment.
import path from 'node:path';
import { beforeAll, expect, it } from 'vitest';
import type { Pose } from '#client/camera/eye';
import { keep_screenshot } from './support/browser';
import { captures_in_motion, errors_px, open_with, type Sweep } from './support/captures';
import { start_delay_proxy } from './support/delay_proxy';
import { catgs_render, start_server } from './support/programs';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'city.ply');
const delay_each_way_ms = 40;

let port: number;

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '200000');
  port = await start_delay_proxy((await start_server(scene)).port, delay_each_way_ms);
});

/** In a street, at eye height. */
const start: Pose = { position: [0, -1.7, 0], orientation: [0, 0, 0, 1] };
const walks: Record<string, Sweep> = {
  'walks on': { move_s: [0, 0, 1.4], sweep_s: 2 },
  'steps aside': { move_s: [1.4, 0, 0], sweep_s: 1 },
};

it('things stay where they are while the camera walks over a slow link', async () => {
  const page = await open_with('on', port);
  for (const [name, walk] of Object.entries(walks)) {
    const captures = await captures_in_motion(page, 4, walk, start);
    const out = path.join(folder, name);
    const errors = (await errors_px(page, scene, out, captures, 'drawn')).flat();
    errors.sort((a, b) => a - b);
    const at = (share: number): number => errors[Math.floor(share * errors.length)]!;
    const lags = captures.map(({ lag_units }) => lag_units.toFixed(2)).join(' ');
    console.log(
      `${name} at 1.4 m/s and ${2 * delay_each_way_ms} ms: ${errors.length} blocks, median ` +
        `${at(0.5).toFixed(2)} px, p95 ${at(0.95).toFixed(2)} px; lags of ${lags} m`,
    );
    await keep_screenshot(page, `smooth_walking_${name.replace(' ', '_')}`);
    expect(Math.max(...captures.map(({ lag_units }) => lag_units))).toBeGreaterThan(0.08);
    expect(errors.length).toBeGreaterThan(40);
    // Few blocks are matched wrongly; depth_warp.test.ts, whose scene has no such blocks, bounds p95.
    expect(at(0.5)).toBeLessThanOrEqual(1);
  }
});
