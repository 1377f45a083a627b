// Captures of a page whose camera moves over a slow link, compared with what catgs-render draws for the
// camera of that moment.
import { mkdirSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { angle_between, length, sub, type Vec3 } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { choose_full_size, open } from './browser';
import { settle } from './camera';
import { read_png, type Picture } from './pictures';
import { catgs_render } from './programs';
import { block_shifts } from './registration';
import { write_tum } from './scenes';

/** A sweep to and fro about the pose at which it begins. */
export interface Sweep {
  /** About the world's up, which is -y. */
  readonly turn_rad_s?: number;
  /** Along axes of the world, units a second. */
  readonly move_s?: Vec3;
  readonly sweep_s: number;
}

export interface Capture {
  readonly picture: Picture;
  readonly drawn: Pose; // the camera with which the canvas was drawn
  readonly now: Pose; // where the camera was when the canvas was read
  readonly fov_y_rad: number;
  readonly uncovered: number;
  readonly lag_deg: number; // how far the camera had turned since the newest picture
  readonly lag_units: number; // how far it had moved since
}

/** Opens the page on the spot, with the warp on or off. */
export async function open_with(warp: 'on' | 'off', port: number): Promise<Page> {
  const viewport = { width: 480, height: 270 };
  const { page } = await open(`http://127.0.0.1:${port}/?presenter=webgl2`, { viewport });
  await choose_full_size(page);
  await page.getByRole('button', { name: 'Quality and view' }).click();
  await page.getByLabel('Smooth turning').selectOption(warp);
  await page.keyboard.press('Escape');
  await page.keyboard.press('KeyM'); // fly: turning on the spot
  await page.mouse.move(240, 135);
  await page.mouse.wheel(0, -600);
  await settle(page);
  return page;
}

/** Sweeps about `start` (else where the camera is), and reads the canvas in the middle of some sweeps. */
export async function captures_in_motion(
  page: Page,
  count: number,
  sweep: Sweep,
  start?: Pose,
): Promise<Capture[]> {
  const raw = await page.evaluate(
    async ([wanted, { turn_rad_s, move_s, sweep_s }, given]) => {
      const catgs = window.catgs!;
      const origin = given ?? catgs.pose();
      const pose_at = (seconds: number): Pose => {
        const [x, y, z, w] = origin.orientation;
        const angle = seconds * (turn_rad_s ?? 0);
        const [s, c] = [-Math.sin(angle / 2), Math.cos(angle / 2)];
        const [px, py, pz] = origin.position;
        const [mx, my, mz] = move_s ?? [0, 0, 0];
        return {
          position: [px + seconds * mx, py + seconds * my, pz + seconds * mz],
          orientation: [c * x + s * z, c * y + s * w, c * z - s * x, c * w - s * y],
        };
      };
      const found = [];
      const begin = performance.now();
      let captured_sweep = 2; // the first ones warm up
      while (found.length < wanted) {
        await new Promise(requestAnimationFrame);
        const seconds = (performance.now() - begin) / 1000;
        const number = Math.floor(seconds / sweep_s);
        const along = seconds - number * sweep_s;
        catgs.setPose(pose_at((number % 2 === 0 ? along : sweep_s - along) - sweep_s / 2));
        if (number > captured_sweep && along > 0.8 * sweep_s) {
          captured_sweep = number;
          const shot = await catgs.snapshot();
          const { position: p, orientation: q } = shot.header.renderPose!;
          const rendered: Pose = {
            position: [p!.x, p!.y, p!.z],
            orientation: [q!.x, q!.y, q!.z, q!.w],
          };
          found.push({ ...shot, header: undefined, rendered, now: catgs.pose() });
        }
      }
      return found;
    },
    [count, sweep, start] as const,
  );
  return raw.map(({ width_px, height_px, rgba, view, rendered, now }) => ({
    picture: { width: width_px, height: height_px, rgba },
    drawn: view,
    now,
    fov_y_rad: view.fov_y_rad,
    uncovered: view.uncovered,
    lag_deg: (angle_between(view.orientation, rendered.orientation) * 180) / Math.PI,
    lag_units: length(sub(view.position, rendered.position)),
  }));
}

/** How far each capture's blocks are from where catgs-render draws them for that camera. */
export async function errors_px(
  page: Page,
  scene: string,
  out: string,
  shots: readonly Capture[],
  camera: 'drawn' | 'now',
): Promise<number[][]> {
  const errors: number[][] = [];
  for (const [i, shot] of shots.entries()) {
    const folder = `${out}-${i}`;
    mkdirSync(folder);
    const trace = path.join(folder, 'pose.tum');
    write_tum(trace, [shot[camera]]);
    catgs_render(
      ...['frames', scene, '--trace', trace, '--out', path.join(folder, 'images')],
      ...['--size', `${shot.picture.width}x${shot.picture.height}`],
      ...['--fov-deg', String((shot.fov_y_rad * 180) / Math.PI)],
    );
    const truth = await read_png(page, path.join(folder, 'images', 'frame_000000.png'));
    const shifts = block_shifts(shot.picture, truth);
    errors.push(shifts.map(({ dx, dy }) => Math.hypot(dx, dy)));
  }
  return errors;
}
