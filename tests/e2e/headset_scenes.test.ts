// A visitor with a headset in scenes of the real server: teleport, stops, hotspots and portals.
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, expect, it } from 'vitest';
import type { Vec3 } from '#client/base/vector';
import { keep_screenshot, open } from './support/browser';
import { distance, pose_of } from './support/camera';
import {
  enter,
  eyes_m,
  in_room,
  pointing,
  press,
  pull_trigger,
  push_stick,
  put,
  refreshes,
  standing,
  with_headset,
} from './support/headset';
import { coverage, read_png } from './support/pictures';
import { artefacts } from './support/paths';
import { catgs_render, start_server, type RunningServer } from './support/programs';
import { make_streets, scratch_folder } from './support/scenes';

const folder = scratch_folder();
const crossing: Vec3 = [0, -eyes_m, -8]; // y points down, and the ground lies at 0
const marker: Vec3 = [0, -1.6, -2];
const gate: Vec3 = [2, -1.6, 8];

let server: RunningServer;

beforeAll(async () => {
  const stop = (title: string, position: Vec3, more: object) => ({
    title,
    position,
    look_at: [0, -1.6, 60],
    ...more,
  });
  const scene = make_streets(folder, 'The streets', [
    stop('The crossing', crossing, { caption: 'Here the streets meet.' }),
    stop('Up the street', [0, -eyes_m, 0], { marker }),
    stop('The gate', [0, -eyes_m, 4], { marker: gate, portal: { scene: 'park' } }),
  ]);
  catgs_render('floors', scene, path.join(folder, 'city.walk'), '--eye-height', String(eyes_m));
  catgs_render('synth', 'garden', path.join(folder, 'park.ply'), '--gaussians', '30000');
  server = await start_server(scene, ['--scene-folder', folder, '--min-fps', '0']);
});

const desktop = { viewport: { width: 1280, height: 640 } };

/** Opens the crossing, waits for the walkable area, and enters. */
async function visit(): Promise<{ page: Page; errors: string[] }> {
  const { page, errors } = await open(`${server.url}?scene=city#stop=1`, desktop, with_headset);
  await page.locator('#button-plan').waitFor({ state: 'visible' });
  await enter(page);
  await expect
    .poll(async () =>
      distance(await pose_of(page), { position: crossing, orientation: [0, 0, 0, 1] }),
    )
    .toBeLessThan(0.6);
  return { page, errors };
}

/** Keeps what both eyes see, and returns how much of it is not dark. */
async function seen(page: Page, name: string): Promise<number> {
  await refreshes(page, 30);
  await keep_screenshot(page, name);
  return coverage(await read_png(page, path.join(artefacts, `${name}.png`)));
}

/** Points the right hand at a point of the world. */
async function point_at(
  page: Page,
  point: Vec3,
  hand: 'right' | 'right hand' = 'right',
): Promise<void> {
  const there = in_room(point, await pose_of(page), standing);
  await put(page, hand, pointing([0.2, -1.3, 0.3], there));
}

/** Holds the trigger until there is time to aim. */
async function hold(page: Page): Promise<void> {
  await pull_trigger(page, 1);
  await page.waitForTimeout(800);
  await pull_trigger(page, 0);
}

it('a visitor teleports along the street, and stays at eye height', async () => {
  const { page, errors } = await visit();
  const begin = await pose_of(page);
  expect(await seen(page, 'headset-street')).toBeGreaterThan(0.5);
  await put(page, 'right', pointing([0.2, -1.3, 0.3], [0.2, -1.3, 9]));
  await push_stick(page, 'right', 0, -1);
  await seen(page, 'headset-teleport');
  await push_stick(page, 'right', 0, 0);
  await expect.poll(async () => distance(await pose_of(page), begin)).toBeGreaterThan(2);
  const there = await pose_of(page);
  expect(there.position[2] - begin.position[2]).toBeGreaterThan(2);
  expect(Math.abs(there.position[1] + eyes_m)).toBeLessThan(0.6);
  await expect.poll(() => seen(page, 'headset-teleported')).toBeGreaterThan(0.5);
  // The trigger does the same.
  await hold(page);
  await expect.poll(async () => distance(await pose_of(page), there)).toBeGreaterThan(2);
  expect(errors).toEqual([]);
});

it('a visitor presses a stop with a pinch, and is there without a flight', async () => {
  const { page, errors } = await visit();
  await page.evaluate(() => (window.emulated!.primaryInputMode = 'hand'));
  await point_at(page, marker, 'right hand');
  await seen(page, 'headset-hotspot');
  await press(page, true);
  await page.getByText('2 of 3').waitFor({ state: 'attached' });
  const { position } = await pose_of(page);
  expect(Math.abs(position[0])).toBeLessThan(0.3);
  expect(Math.abs(position[2])).toBeLessThan(0.3);
  await expect.poll(() => seen(page, 'headset-at-stop')).toBeGreaterThan(0.5);
  expect(errors).toEqual([]);
});

it('a visitor goes through a portal, and leaves in the other scene', async () => {
  const { page, errors } = await visit();
  await point_at(page, gate);
  await press(page);
  await page.getByText('3 of 3').waitFor({ state: 'attached' });
  await expect.poll(() => seen(page, 'headset-portal')).toBeGreaterThan(0.5);
  await point_at(page, gate);
  await press(page); // who is at a portal goes through it by the same sign
  const scene = (): Promise<string> => page.locator('#scene-name bdi').innerText();
  await expect.poll(scene).toBe('park');
  await expect.poll(() => seen(page, 'headset-park')).toBeGreaterThan(0.3);
  // Nobody knows a walkable area here: the visitor comes to what they point at, beside the panel.
  const arrived = await pose_of(page);
  await put(page, 'right', pointing([0.7, -1.3, 0.3], [1.4, 0, 2.5]));
  await expect
    .poll(async () => {
      await hold(page);
      return distance(await pose_of(page), arrived);
    })
    .toBeGreaterThan(0.1);
  await seen(page, 'headset-park-teleported');
  await page.evaluate(() => window.emulated!.activeSession!.end());
  expect(errors).toEqual([]);
});
