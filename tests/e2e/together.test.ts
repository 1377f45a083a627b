// Watching together: one page leads, others follow its camera or watch its pictures. Against the real server.
import { writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { barriers } from './support/axe';
import { keep_screenshot, new_page, open, windows } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { present } from './support/company';
import { access_token, catgs_render, start_server, type RunningServer } from './support/programs';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'hall.ply');
const key_file = path.join(folder, 'key');
const counted = ['--min-fps', '0']; // places are counted, whatever this machine can do

beforeAll(() => {
  catgs_render('synth', 'city', scene, '--gaussians', '30000');
  writeFileSync(key_file, '0123456789abcdef0123456789abcdef');
});

async function move(page: Page): Promise<void> {
  await page.keyboard.press('Escape');
  await page.locator('#view').focus();
  for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowLeft');
  await settle(page);
}

const apart = async (a: Page, b: Page): Promise<number> =>
  distance(await pose_of(a), await pose_of(b));

describe('a presentation', () => {
  it('leads others on streams of their own, who may leave it and come back', async () => {
    const server = await start_server(scene, counted);
    const { page: leader, errors } = await open(server.url, windows.desktop);
    const link = await present(leader);
    await keep_screenshot(leader, 'together-present');
    expect(await barriers(leader)).toEqual([]);
    const { page: follower, errors: more } = await open(link, windows.phone);
    await follower.getByText('Ada leads').waitFor();
    await leader.getByText('You lead. One person follows.').waitFor();
    await move(leader);
    await expect.poll(() => apart(leader, follower)).toBeLessThan(1e-3);
    await keep_screenshot(follower, 'together-follow');
    expect(await barriers(follower)).toEqual([]);

    // A gesture leaves, and one tap comes back.
    await follower.locator('#view').focus();
    await follower.keyboard.press('ArrowUp');
    const again = follower.getByRole('button', { name: 'Follow Ada' });
    await again.waitFor();
    await leader.getByText('You lead. Nobody follows yet.').waitFor();
    await move(leader);
    expect(await apart(leader, follower)).toBeGreaterThan(0.01);
    await keep_screenshot(follower, 'together-left');
    await again.tap();
    await expect.poll(() => apart(leader, follower)).toBeLessThan(1e-3);

    await leader.getByRole('button', { name: 'Stop' }).first().click();
    await follower.getByText('The presentation is over').waitFor();
    expect([...errors, ...more]).toEqual([]);
  });

  it('points at places, for all to see', async () => {
    const server = await start_server(scene, counted);
    const { page: leader } = await open(server.url, windows.desktop);
    const link = await present(leader);
    await leader.keyboard.press('Escape');
    const { page: follower, errors } = await open(link, windows.phone);
    await follower.getByText('Ada leads').waitFor();
    const rings = (page: Page): Promise<number> => page.locator('.ping').count();
    // By Alt and a click.
    await leader.locator('#view').click({ position: { x: 640, y: 500 }, modifiers: ['Alt'] });
    await follower.getByText('Ada points at a place').waitFor({ state: 'attached' });
    await expect.poll(() => rings(leader)).toBe(1);
    expect(await rings(follower)).toBe(1);
    await keep_screenshot(leader, 'together-ping');
    await keep_screenshot(follower, 'together-ping-phone');
    expect(await barriers(leader)).toEqual([]);
    // By a long press; a follower may not.
    await expect.poll(() => rings(leader)).toBe(0);
    await leader.mouse.move(600, 480);
    await leader.mouse.down();
    await expect.poll(() => rings(follower)).toBe(1);
    await leader.mouse.up();
    expect(await follower.locator('#company-point').isHidden()).toBe(true);
    // The leader lets followers point, and hears where all are.
    await leader.getByRole('button', { name: 'Share' }).click();
    await leader.getByLabel('Those who follow may point at places').check();
    await leader.getByLabel('Those who follow see where everybody is').check();
    await keep_screenshot(leader, 'together-allowed');
    const point = follower.getByRole('button', { name: 'Point at the middle' });
    await point.waitFor();
    await expect.poll(() => rings(leader)).toBe(0);
    await point.tap();
    await leader.getByText('Somebody points at a place').waitFor({ state: 'attached' });
    await keep_screenshot(follower, 'together-may-point');
    expect(await barriers(follower)).toEqual([]);
    expect(errors).toEqual([]);
  });

  it('is watched where no place is free, and left for a visit from where the leader stood', async () => {
    const server = await start_server(scene, [...counted, '--max-sessions', '1']);
    const { page: leader } = await open(server.url, windows.desktop);
    const link = await present(leader);
    await move(leader);
    const stood = await pose_of(leader);
    const { page: watcher } = await new_page(windows.phone);
    await watcher.goto(link);
    await watcher.getByText('Ada leads').waitFor();
    await watcher.locator('#card').waitFor({ state: 'hidden' });
    await keep_screenshot(watcher, 'together-watch');
    expect(await barriers(watcher)).toEqual([]);
    expect(await watcher.getByRole('button', { name: 'Quality and view' }).isHidden()).toBe(true);
    // The ring is where the leader points, though this picture has another shape.
    await leader.locator('#view').click({ position: { x: 640, y: 500 }, modifiers: ['Alt'] });
    await watcher.locator('.ping').waitFor({ state: 'attached' });
    const at = await watcher.locator('.ping').evaluate((ring) => {
      const { x, y } = ring.getBoundingClientRect();
      return [x / innerWidth - 0.5, (y - innerHeight / 2) / innerWidth];
    });
    expect(at[0]).toBeCloseTo(0, 1);
    expect(at[1]).toBeCloseTo((500 - 360) / 1280, 1);
    await keep_screenshot(watcher, 'together-ping-watched');
    await watcher.keyboard.press('KeyM');
    expect(await watcher.evaluate(() => document.querySelector('#mode-label')!.textContent)).toBe(
      'Orbit',
    );
    await leader.goto('about:blank'); // its place is free
    await watcher.getByText('Nobody leads here now').waitFor();
    await watcher.getByRole('button', { name: 'Look around myself' }).tap();
    await watcher.getByRole('button', { name: 'Share' }).waitFor();
    await settle(watcher);
    expect(distance(stood, await pose_of(watcher))).toBeLessThan(1e-3);
  });

  it('grants watching to those without a token, and is found by links of role spectator', async () => {
    const server: RunningServer = await start_server(scene, [
      ...counted,
      '--token-key-file',
      key_file,
    ]);
    const { page: spectator } = await new_page(windows.desktop);
    await spectator.goto(`${server.url}#token=${access_token('spectator', key_file)}`);
    await spectator.getByRole('heading', { name: 'Nobody leads here now' }).waitFor();
    await keep_screenshot(spectator, 'together-nobody');
    const { page: leader } = await open(
      `${server.url}#token=${access_token('viewer', key_file)}`,
      windows.desktop,
    );
    const link = await present(leader);
    expect(link).not.toContain('token=');
    await spectator.getByText('Ada leads').waitFor();
    const { page: guest } = await new_page(windows.desktop);
    await guest.goto(link);
    await guest.getByText('Ada leads, 2 follow').waitFor();
    await guest.locator('#card').waitFor({ state: 'hidden' });
    await keep_screenshot(guest, 'together-guest');
    expect(await guest.locator('#company-action').isHidden()).toBe(true);
    await leader.locator('#present-stop').click();
    for (const page of [spectator, guest])
      await page.getByRole('heading', { name: 'Nobody leads here now' }).waitFor();
    await leader.getByRole('button', { name: 'Present', exact: true }).click();
    for (const page of [spectator, guest]) await page.getByText('Ada leads').waitFor();
  });
});
