// Pictures and a film that an author orders from the real server.
import { readFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { barriers } from './support/axe';
import { keep_screenshot, open, windows } from './support/browser';
import { pose_of, settle } from './support/camera';
import {
  access_token,
  catgs_render,
  start_server,
  type RunningServer,
  with_tokens,
} from './support/programs';
import { scratch_folder, write_tours } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'town.ply');

let server: RunningServer;

beforeAll(async () => {
  catgs_render('synth', 'garden', scene, '--gaussians', '20000');
  write_tours(path.join(folder, 'town.json'), ({ start_pose, focus }) => {
    const at = (share: number): number[] =>
      start_pose.position.map((v, i) => v + (focus[i]! - v) * share);
    const stop = (share: number) => ({
      title: `Stop ${share}`,
      position: at(share),
      look_at: focus,
      stay_s: 0.3,
      fly_s: 0.5,
    });
    return [{ title: 'A short film', stops: [stop(0.1), stop(0.2)] }];
  });
  server = await start_server(scene, [...with_tokens, '--min-fps', '0']);
});

const link = (role: string, query = ''): string =>
  `${server.url}?author${query}#token=${access_token(role)}`;

async function open_panel(page: Page): Promise<void> {
  await page.getByText('Pictures and film').click();
  await page.getByLabel('Kind').waitFor();
}

/** Orders and saves the result. */
async function made(page: Page, kind: string, size: string): Promise<Buffer> {
  await page.getByLabel('Kind').selectOption(kind);
  await page.getByLabel('Size').selectOption(size);
  await page.getByRole('button', { name: 'Create' }).click();
  await page.getByText('Ready.').waitFor({ timeout: 100_000 });
  const [download] = await Promise.all([
    page.waitForEvent('download'),
    page.getByRole('link', { name: 'Save it on this device' }).click(),
  ]);
  return readFileSync(await download.path());
}

const png_size = (png: Buffer): [number, number] => [png.readUInt32BE(16), png.readUInt32BE(20)];

describe('an author', () => {
  it('gets a picture of the view', async () => {
    const { page, errors } = await open(link('author'), windows.desktop);
    await open_panel(page);
    const whole = await made(page, 'picture', '1920 × 1080');
    expect(png_size(whole)).toEqual([1920, 1080]);
    await keep_screenshot(page, 'film-picture');
    const { position, orientation } = await pose_of(page);
    const view = [...position, ...orientation, 60].join(',');
    await page.evaluate((at) => (location.hash = `at=${at}&section=0,900,0,1,1,1,0`), view);
    await settle(page);
    const empty = await made(page, 'picture', '1920 × 1080');
    expect(empty.length).toBeLessThan(whole.length / 10);
    expect(await barriers(page)).toEqual([]);
    expect(errors).toEqual([]);
  });

  it('gets a film of the tour, or cancels it', async () => {
    const { page } = await open(link('author'), windows.desktop);
    await open_panel(page);
    const film = await made(page, 'film', '1280 × 720');
    expect(film.toString('latin1', 4, 8)).toBe('ftyp');
    expect(film.includes('avcC')).toBe(true); // H.264
    await page.getByLabel('Size').selectOption('1920 × 1080');
    await page.getByRole('button', { name: 'Create' }).click();
    await page.getByRole('button', { name: 'Cancel' }).click();
    await page.getByText('Cancelled.').waitFor();
    const [path_file] = await Promise.all([
      page.waitForEvent('download'),
      page.getByRole('button', { name: 'Save the camera path' }).click(),
    ]);
    const lines = readFileSync(await path_file.path(), 'utf8')
      .trimEnd()
      .split('\n');
    expect(lines.length).toBe(33); // 1.1 s
    await page.getByText('catgs-render frames').waitFor();
  });

  it.each(['en', 'de', 'ar'])('has a panel that looks right on a phone: %s', async (language) => {
    const { page } = await open(link('author', `&lang=${language}`), windows.phone);
    await page.locator('#author-film summary').tap();
    await page.locator('#author-film select').first().selectOption('film');
    await page.locator('#author-film').scrollIntoViewIfNeeded();
    await keep_screenshot(page, `film-${language}`);
    expect(await barriers(page)).toEqual([]);
  });
});

it('a film is made for authors alone, within bounds', async () => {
  const order = (role: string, body: object): Promise<Response> =>
    fetch(`${server.url}api/scenes/town/films`, {
      method: 'PUT',
      body: JSON.stringify(body),
      headers: { authorization: `Bearer ${access_token(role)}` },
    });
  const request = { kind: 'film', size: [64, 48], views: [[0, 0, -5, 0, 0, 0, 1, 60], 17_000] };
  expect((await order('viewer', request)).status).toBe(403);
  const damaged = await order('author', { ...request, views: [[0, 0, 'far']] });
  expect([damaged.status, await damaged.text()]).toEqual([
    400,
    expect.stringContaining('views[0]'),
  ]);
  const around = await order('author', {
    kind: 'panorama',
    size: [256, 128],
    views: [[0, -2, -9, 0, 0, 0, 1, 90]],
  });
  expect(around.status).toBe(202);
  const job = `${server.url}api/films/${((await around.json()) as { id: string }).id}`;
  await expect
    .poll(async () => ((await (await fetch(job)).json()) as { state: string }).state)
    .toBe('done');
  expect(png_size(Buffer.from(await (await fetch(`${job}/file`)).arrayBuffer()))).toEqual([
    256, 128,
  ]);
  expect((await fetch(`${server.url}api/films/0123456789abcdef0123456789abcdef`)).status).toBe(404);
});

it('a visitor may save the camera path, and learns who may order', async () => {
  const { page } = await open(link('viewer'), windows.desktop);
  await open_panel(page);
  await page.getByText('To create one here, open an author link.').waitFor();
  expect(await page.getByRole('button', { name: 'Create' }).isHidden()).toBe(true);
  await page.getByLabel('Kind').selectOption('film');
  expect(await page.getByRole('button', { name: 'Save the camera path' }).isVisible()).toBe(true);
});
