// Checks that things are where they belong while the camera turns over a slow link. It compares the canvas
// with what catgs-render draws for the camera of that moment.
import path from 'node:path';
import { beforeAll, expect, it } from 'vitest';
import { captures_in_motion, errors_px, open_with } from './support/captures';
import { start_delay_proxy } from './support/delay_proxy';
import { catgs_render, start_server } from './support/programs';
import { median } from './support/registration';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'city.ply');
const delay_each_way_ms = 40;
const deg_per_s = 60;
const sweep = {
  turn_rad_s: (deg_per_s * Math.PI) / 180,
  sweep_s: 1.4 / ((deg_per_s * Math.PI) / 180),
};

let port: number;

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '60000');
  port = await start_delay_proxy((await start_server(scene)).port, delay_each_way_ms);
});

/** NaN: too few blocks have structure. */
const median_of_many = (errors: number[]): number => (errors.length >= 5 ? median(errors) : NaN);

it('things stay where they are while the camera turns over a slow link', async () => {
  const page = await open_with('on', port);
  const captures = await captures_in_motion(page, 4, sweep);
  const errors = (await errors_px(page, scene, path.join(folder, 'warp'), captures, 'drawn')).map(
    median_of_many,
  );
  const uncovered = captures.map((shot) => shot.uncovered);
  await page.close();

  const plain = await open_with('off', port);
  const unwarped = await captures_in_motion(plain, 2, sweep);
  const without = (await errors_px(plain, scene, path.join(folder, 'plain'), unwarped, 'now')).map(
    median_of_many,
  );
  const list = (values: number[], digits: number): string =>
    values.map((v) => v.toFixed(digits)).join(' ');
  console.log(
    `at ${deg_per_s} deg/s and ${2 * delay_each_way_ms} ms: registration ${list(errors, 2)} px, ` +
      `uncovered ${list(
        uncovered.map((v) => 100 * v),
        2,
      )} % at lags of ` +
      `${list(
        captures.map(({ lag_deg }) => lag_deg),
        1,
      )} deg; ` +
      `without warp ${list(without, 1)} px (nan: beyond the search)`,
  );
  expect(errors.every(Number.isFinite)).toBe(true);
  expect(median(errors)).toBeLessThanOrEqual(1);
  // The largest overscan reaches this far. A busier machine lags more, and the figures above show it.
  const reached = captures.filter(({ lag_deg }) => lag_deg < 10);
  expect(Math.max(0, ...reached.map((shot) => shot.uncovered))).toBeLessThanOrEqual(0.01);
});
