// A head that moves over a slow link: both eyes against what catgs-render draws for each of them.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, expect, it } from 'vitest';
import { add, rotate } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { keep_screenshot, open } from './support/browser';
import { pose_of } from './support/camera';
import { start_delay_proxy } from './support/delay_proxy';
import { between_eyes_m, enter, with_headset } from './support/headset';
import { read_png, type Picture } from './support/pictures';
import { catgs_render, start_server } from './support/programs';
import { block_shifts, median } from './support/registration';
import { scratch_folder, write_tum } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'city.ply');
const delay_each_way_ms = 40;
const eye_px = 320; // of each side; an eye sees 90 degrees
const degree_px = (Math.PI / 180) * (eye_px / 2);
const start: Pose = { position: [0, -1.7, 0], orientation: [0, 0, 0, 1] };

let port: number;

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '200000');
  const sidecar = path.join(folder, 'city.json');
  const said = JSON.parse(readFileSync(sidecar, 'utf8')) as object;
  writeFileSync(sidecar, JSON.stringify({ ...said, metres_per_unit: 1 }));
  const server = await start_server(scene, ['--min-fps', '0']);
  port = await start_delay_proxy(server.port, delay_each_way_ms);
});

interface Shot {
  readonly picture: Picture;
  /** The head in the world when both eyes were drawn. */
  readonly head: Pose;
}

/** Turns and sways the head, and takes what its eyes see in the middle of some movements. */
async function shots_in_motion(page: Page, count: number): Promise<Shot[]> {
  const raw = await page.evaluate(
    (wanted) =>
      new Promise<readonly Shot[]>((resolve) => {
        const { activeSession: session, quaternion, position } = window.emulated!;
        const canvas = document.querySelector<HTMLCanvasElement>('[data-webxr_runtime] canvas')!;
        const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', {
          willReadFrequently: true,
        })!;
        const begin = performance.now();
        const shots: Shot[] = [];
        let next_s = 4; // the first movements warm up
        // Hears each refresh after the page, which has asked for it before.
        const refreshed = (): void => {
          const seconds = (performance.now() - begin) / 1000;
          if (seconds > next_s) {
            next_s = seconds + 0.7;
            copy.drawImage(canvas, 0, 0);
            const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
            const picture = { width: canvas.width, height: canvas.height, rgba: data };
            const head = window.catgs!.pose();
            shots.push({ picture, head });
          }
          if (shots.length === wanted) return resolve(shots);
          const turn = 0.35 * Math.sin(seconds); // up to 20 degrees a second
          const sway = 0.25 * Math.sin(1.4 * seconds);
          quaternion.set(0, Math.sin(turn / 2), 0, Math.cos(turn / 2));
          position.set(sway, 1.6, 0.5 * sway);
          session!.requestAnimationFrame(refreshed);
        };
        session!.requestAnimationFrame(refreshed);
      }),
    count,
  );
  return [...raw];
}

/** What an eye sees between the smooth sky and the panel, without its borders. */
function part_of({ width, rgba }: Picture, left: number): Picture {
  const [columns, rows, top] = [224, 128, 80];
  const part = new Uint8ClampedArray(4 * columns * rows);
  for (let row = 0; row < rows; ++row) {
    const begin = 4 * ((top + row) * width + left + 48);
    part.set(rgba.subarray(begin, begin + 4 * columns), 4 * columns * row);
  }
  return { width: columns, height: rows, rgba: part };
}

/** How far blocks are from where catgs-render draws them for each eye, degrees. */
async function errors_deg(page: Page, { picture, head }: Shot, name: string): Promise<number[]> {
  const errors: number[] = [];
  for (const half of [0, 1] as const) {
    const out = path.join(folder, `${name}-${half}`);
    mkdirSync(out);
    const side = half === 0 ? -1 : 1;
    const aside = rotate(head.orientation, [(side * between_eyes_m) / 2, 0, 0]);
    const trace = path.join(out, 'eye.tum');
    write_tum(trace, [{ ...head, position: add(head.position, aside) }]);
    catgs_render(
      ...['frames', scene, '--trace', trace, '--out', path.join(out, 'images')],
      ...['--size', `${eye_px}x${eye_px}`, '--fov-deg', '90'],
    );
    const truth = await read_png(page, path.join(out, 'images', 'frame_000000.png'));
    const shifts = block_shifts(part_of(picture, half * eye_px), part_of(truth, 0), 32);
    errors.push(...shifts.map(({ dx, dy }) => Math.hypot(dx, dy) / degree_px));
  }
  return errors;
}

it('both eyes see things where they are while the head moves over a slow link', async () => {
  const viewport = { width: 2 * eye_px, height: eye_px };
  const at = [...start.position, ...start.orientation, 60].join();
  const { page, errors } = await open(
    `http://127.0.0.1:${port}/#at=${at}`,
    { viewport },
    with_headset,
  );
  await enter(page);
  await expect.poll(async () => (await pose_of(page)).position[1]).toBeCloseTo(-1.7, 1);
  const shots = await shots_in_motion(page, 4);
  await keep_screenshot(page, 'headset-in-motion');
  const found: number[] = [];
  for (const [i, shot] of shots.entries()) found.push(...(await errors_deg(page, shot, `${i}`)));
  found.sort((a, b) => a - b);
  const p95 = found[Math.floor(0.95 * found.length)]!;
  console.log(
    `${2 * delay_each_way_ms} ms: ${found.length} blocks of both eyes, median ${median(found).toFixed(2)}, ` +
      `p95 ${p95.toFixed(2)} degrees (some blocks match wrongly)`,
  );
  expect((await page.evaluate(() => window.catgs!.stats())).eyes).toBe(2);
  expect(found.length).toBeGreaterThan(40);
  expect(median(found)).toBeLessThan(0.5);
  expect(errors).toEqual([]);
});
