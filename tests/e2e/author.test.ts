// Making a tour in the browser, and saving it to the real server.
import { mkdirSync, readFileSync, rmSync, unlinkSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { BrowserContextOptions, Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import type { Pose } from '#client/camera/eye';
import { keep_screenshot, open, windows, type WatchedPage } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { access_token, catgs_render, start_server, type RunningServer } from './support/programs';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'mine.ply');
const sidecar = path.join(folder, 'mine.json');
const key_file = path.join(folder, 'key');

let workshop: RunningServer;

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '100000');
  unlinkSync(sidecar); // the sidecar of the scene that was just made
  writeFileSync(key_file, '0123456789abcdef0123456789abcdef');
  workshop = await start_server(scene, ['--token-key-file', key_file, '--min-fps', '0']);
});

/** Opens the page by a link of the role. */
const open_as = (role: string, query = '', options: BrowserContextOptions = windows.desktop): Promise<WatchedPage> =>
  open(`${workshop.url}${query}#token=${access_token(role, key_file)}`, options);

describe('an author', () => {
  /** Makes two stops, moves the second one to the front, and lets visits begin there. */
  async function make_tour(page: Page): Promise<Pose> {
    await page.getByRole('region', { name: 'Make a tour' }).waitFor();
    const start = await pose_of(page);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByLabel('Title of stop 1').fill('Where I began');
    await page.getByLabel('Caption of stop 1').fill('It was here.');
    await page.mouse.move(500, 300);
    await page.mouse.wheel(0, -300);
    await settle(page);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByLabel('Title of stop 2').fill('Nearer');
    await page.getByLabel('Title of the tour', { exact: true }).fill('My tour');
    await page.getByRole('button', { name: 'Move stop 2 up' }).click();
    await page.getByRole('button', { name: 'Begin visits here' }).click();
    await page.getByLabel('Title of stop 2').focus();
    await page.getByRole('button', { name: 'Show' }).last().click();
    await settle(page);
    expect(distance(start, await pose_of(page))).toBeLessThan(1e-3);
    return start;
  }

  it('makes a tour, saves it to the server, and visitors who reload follow it', async () => {
    const visitor = await open_as('viewer');
    expect(await visitor.page.locator('#tour').isHidden()).toBe(true);
    const { page, errors } = await open_as('author', '?author');
    const start = await make_tour(page);
    await page.getByRole('button', { name: 'Preview' }).click();
    await page.getByRole('button', { name: 'Pause the tour' }).waitFor();
    await page.getByText('1 of 2').waitFor();
    await page.getByRole('button', { name: 'Pause the tour' }).click();
    await keep_screenshot(page, 'author');
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors get it').waitFor();
    expect(errors).toEqual([]);

    await visitor.page.reload();
    await settle(visitor.page);
    await visitor.page.getByText('My tour').first().waitFor();
    expect(distance(start, await pose_of(visitor.page))).toBeGreaterThan(0.1);
    await visitor.page.getByRole('button', { name: 'Play the tour' }).click();
    await visitor.page.getByRole('heading', { name: 'Nearer' }).waitFor();
    await visitor.page.locator('#tour-text', { hasText: 'It was here.' }).waitFor();
    await settle(visitor.page);
    expect(distance(start, await pose_of(visitor.page))).toBeLessThan(1e-3);
    expect(visitor.errors).toEqual([]);

    // The page shows the server's reason for a refusal, and keeps the work.
    const in_the_way = path.join(folder, '.mine.json.new');
    mkdirSync(in_the_way);
    await page.getByLabel('Title of stop 2').focus();
    await page.getByLabel('Caption of stop 2').fill('Changed.');
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText(/Not saved: mine.json: .*download the file/).waitFor();
    rmSync(in_the_way, { recursive: true });
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors get it').waitFor();
    expect(readFileSync(sidecar, 'utf8')).toContain('Changed.');
  });

  it('is told when another one saved meanwhile, and replaces theirs on purpose only', async () => {
    const edit = async (page: Page, title: string): Promise<void> => {
      await page.getByRole('button', { name: 'Add a stop here' }).click();
      await page.getByLabel('Title of the tour', { exact: true }).fill(title);
      await page.getByRole('button', { name: 'Save to the server' }).click();
    };
    const [{ page: first }, { page: second }] = [
      await open_as('author', '?author'),
      await open_as('author', '?author'),
    ];
    await edit(first, 'By the first');
    await first.getByText('Saved. Visitors get it').waitFor();
    const replace = second.getByRole('button', { name: 'Replace theirs' });
    expect(await replace.isHidden()).toBe(true);
    await edit(second, 'By the second');
    await second.getByText('Not saved: someone else has saved this scene').waitFor();
    await keep_screenshot(second, 'author-changed-meanwhile');
    expect(readFileSync(sidecar, 'utf8')).toContain('By the first');
    await replace.click();
    await second.getByText('Saved. Visitors get it').waitFor();
    expect(await replace.isHidden()).toBe(true);
    expect(readFileSync(sidecar, 'utf8')).toContain('By the second');
    await edit(second, 'By the second again');
    await second.getByText('Saved. Visitors get it').waitFor();
    await edit(first, 'By the first again');
    await first.getByText('Not saved: someone else has saved this scene').waitFor();
  });

  it('whose link is a plain one saves a file, and is told how it gets to visitors', async () => {
    const { page } = await open_as('viewer', '?author');
    await page.getByRole('region', { name: 'Make a tour' }).waitFor();
    expect(await page.getByRole('button', { name: 'Save to the server' }).isHidden()).toBe(true);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Download the file' }).click();
    const file = await download;
    expect(file.suggestedFilename()).toBe('mine.json');
    const { tours } = JSON.parse(readFileSync(await file.path(), 'utf8')) as { tours: unknown };
    expect(tours).toMatchObject([{ stops: expect.any(Array) as unknown }]);
    await page.getByText('link of role author').waitFor();
  });

  it('sees the card of a preview in a window too narrow for it beside the panel', async () => {
    const { page } = await open_as('author', '?author', { viewport: { width: 1000, height: 640 } });
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    expect(await page.locator('#tour').isHidden()).toBe(true);
    await page.getByRole('button', { name: 'Preview' }).click();
    await page.locator('#tour').waitFor();
    expect(await page.locator('#author-panel').isHidden()).toBe(true);
  });

  it.each(['phone', 'desktop-dark'] as const)('has room to see and to write: %s', async (name) => {
    const { page } = await open_as('author', '?author', windows[name]);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await settle(page);
    await keep_screenshot(page, `author-${name}`);
    const { top, bottom } = await page.evaluate(() =>
      document.getElementById('author-panel')!.getBoundingClientRect().toJSON() as DOMRect,
    );
    const { height } = windows[name].viewport;
    expect(bottom).toBeLessThanOrEqual(height);
    if (name === 'phone') expect(top).toBeGreaterThan(0.4 * height);
  });
});
