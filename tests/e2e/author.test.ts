// Making a tour in the browser, and saving it to the real server.
import { mkdirSync, readFileSync, rmSync, unlinkSync } from 'node:fs';
import path from 'node:path';
import type { BrowserContextOptions, Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import type { Pose } from '#client/camera/eye';
import { barriers } from './support/axe';
import { keep_screenshot, open, windows, type WatchedPage } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { start_delay_proxy } from './support/delay_proxy';
import {
  access_token,
  catgs_render,
  start_server,
  type RunningServer,
  with_tokens,
} from './support/programs';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'mine.ply');
const sidecar = path.join(folder, 'mine.json');

let workshop: RunningServer;

beforeAll(async () => {
  catgs_render('synth', 'garden', scene, '--gaussians', '20000');
  unlinkSync(sidecar); // the sidecar of the scene that was just made
  workshop = await start_server(scene, [...with_tokens, '--min-fps', '0']);
});

/** Opens the page by a link of the role. */
const open_as = (
  role: string,
  query = '',
  options: BrowserContextOptions = windows.desktop,
): Promise<WatchedPage> => open(`${workshop.url}${query}#token=${access_token(role)}`, options);

describe('an author', () => {
  /** Makes two stops, moves the second one to the front, and lets visits begin there. */
  async function make_tour(page: Page): Promise<Pose> {
    await page.getByRole('region', { name: 'Make a tour' }).waitFor();
    const start = await pose_of(page);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByLabel('Title of stop 1').fill('Where I began');
    await page.getByLabel('Caption of stop 1').fill('It was here.');
    await page.mouse.move(500, 300);
    await page.keyboard.down('Control'); // as browsers tell of a pinch, which moves visitors in every mode
    await page.mouse.wheel(0, -300);
    await page.keyboard.up('Control');
    await settle(page);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByLabel('Title of stop 2').fill('Nearer');
    await page.getByLabel('Title of the tour', { exact: true }).fill('My tour');
    await page.getByRole('button', { name: 'Move stop 2 up' }).click();
    await page.getByRole('button', { name: 'Start visits here' }).click();
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
    await keep_screenshot(page, 'author');
    await page.getByText('About the scene').click();
    await page.getByLabel('Title', { exact: true }).fill('The old city');
    await page.getByLabel('Credits').fill('Ada Lovelace');
    await page.getByLabel('Licence').fill('CC-BY-4.0');
    await page.getByLabel('Visitors start in').selectOption('Walk');
    await page.getByLabel('Background').fill('#203040');
    await keep_screenshot(page, 'author-about');
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors see it').waitFor();
    expect(errors).toEqual([]);

    await visitor.page.reload();
    await settle(visitor.page);
    await visitor.page.getByText('My tour').first().waitFor();
    await visitor.page.getByText('The old city').waitFor();
    await visitor.page.getByText('Ada Lovelace · CC-BY-4.0').waitFor();
    await visitor.page.locator('#mode-label', { hasText: 'Walk' }).waitFor();
    await keep_screenshot(visitor.page, 'author-visitor');
    expect(distance(start, await pose_of(visitor.page))).toBeGreaterThan(0.1);
    await visitor.page.getByRole('button', { name: 'Play the tour' }).click();
    await visitor.page.getByRole('heading', { name: 'Nearer' }).waitFor();
    await visitor.page.locator('#tour-text', { hasText: 'It was here.' }).waitFor();
    await settle(visitor.page);
    expect(distance(start, await pose_of(visitor.page))).toBeLessThan(1e-3);
    expect(visitor.errors).toEqual([]);

    // The page shows the server's reason for a refusal, and keeps the work.
    const in_the_way = path.join(folder, 'mine.json.bak');
    rmSync(in_the_way, { force: true });
    mkdirSync(path.join(in_the_way, 'kept'), { recursive: true });
    await page.getByLabel('Title of stop 2').focus();
    await page.getByLabel('Caption of stop 2').fill('Changed.');
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText(/Not saved: mine.json: .*download the file/).waitFor();
    rmSync(in_the_way, { recursive: true });
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors see it').waitFor();
    expect(readFileSync(sidecar, 'utf8')).toContain('Changed.');
  });

  it('sees three stops and more on a usual screen', async () => {
    const { page } = await open_as('author', '?author', { viewport: { width: 1440, height: 900 } });
    const add = page.getByRole('button', { name: 'Add a stop here' });
    const stops = page.locator('#author-stops > li');
    await add.waitFor();
    const before = await stops.count();
    for (let n = before + 1; n <= before + 4; ++n) {
      await add.click();
      await page.getByLabel(`Title of stop ${n}`).waitFor();
    }
    await page.getByLabel('Title of stop 1', { exact: true }).focus();
    const list = (await page.locator('#author-stops').boundingBox())!;
    const boxes = await Promise.all((await stops.all()).map((stop) => stop.boundingBox()));
    const seen = boxes.filter(
      (box) => box!.y >= list.y && box!.y + box!.height <= list.y + list.height,
    );
    expect(seen.length).toBeGreaterThanOrEqual(3);
  });

  it('keeps measures for visitors, who add their own in links', async () => {
    /** Marks two points of the ground. */
    const measure = async (page: Page): Promise<void> => {
      await page.locator('#measure-results p').waitFor();
      const { width, height } = page.viewportSize()!;
      const dots = page.locator('#measure-lines circle');
      const before = await dots.count();
      for (const [k, x] of [0.35, 0.5].entries()) {
        await page.mouse.click(x * width, 0.6 * height);
        await expect.poll(() => dots.count()).toBe(before + k + 1);
      }
    };
    const { page, errors } = await open_as('author', '?author');
    const stops = page.locator('#author-stops > li');
    await page.getByText('About the scene').waitFor();
    const before = await stops.count();
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await expect.poll(() => stops.count()).toBe(before + 1);
    await page.getByLabel('Title of stop 1', { exact: true }).focus();
    await page.getByLabel('Flight, s (1)').fill('3,2');
    await page.getByLabel('Stay, s (1)').fill('4000');
    await expect
      .poll(() =>
        page
          .getByLabel('Stay, s (1)')
          .evaluate((field: HTMLInputElement) => field.validationMessage),
      )
      .toBe('Enter a number from 0 to 3,600.');
    await page.getByLabel('Stay, s (1)').fill('');
    await page.getByRole('button', { name: 'Measure', exact: true }).click();
    await page.locator('#measure-results p').waitFor();
    await page.getByLabel('Units').selectOption('Metric');
    await measure(page);
    const number = page.locator('#measure-lines .length');
    const length = await number.textContent();
    const end = page.getByRole('button', { name: /^Point 2 of Measure 1;/ });
    const box = (await end.boundingBox())!;
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + 120, box.y + 30, { steps: 4 });
    await page.mouse.up();
    await expect.poll(() => number.textContent()).not.toBe(length);
    await page.getByLabel('This length in metres').fill('0');
    await page.getByRole('button', { name: 'Set the scale' }).click();
    expect(await page.locator('#measure-known:invalid').count()).toBe(1);
    await page.getByLabel('This length in metres').fill('3,2');
    await page.getByRole('button', { name: 'Set the scale' }).click();
    await expect
      .poll(() => page.locator('#measure-results dd').first().textContent())
      .toMatch(/^3\.2\d*\sm ±/);
    await page.getByLabel('Name of measure 1').fill('The gate');
    await keep_screenshot(page, 'measures');
    expect(await barriers(page)).toEqual([]);
    await page.getByRole('button', { name: 'Make a tour' }).click();
    // The save waits for the mark, which the server still looks for.
    await page.evaluate(() => {
      for (const id of ['measure-middle', 'author-save']) document.getElementById(id)!.click();
    });
    await page.getByText('Saved. Visitors see it').waitFor();
    const saved = JSON.parse(readFileSync(sidecar, 'utf8')) as {
      readonly measures: readonly { readonly title: string; readonly marks: readonly unknown[] }[];
      readonly tours: readonly { readonly stops: readonly { readonly fly_s?: number }[] }[];
    };
    expect(saved.measures).toMatchObject([{ title: 'The gate' }]);
    expect(saved.measures[0]!.marks).toHaveLength(3);
    expect(saved.tours[0]!.stops.some(({ fly_s }) => fly_s === 3.2)).toBe(true);
    expect(errors).toEqual([]);

    const visitor = await open_as('viewer');
    await settle(visitor.page);
    await visitor.page.getByRole('button', { name: 'Measure', exact: true }).click();
    await visitor.page.getByRole('button', { name: 'The gate' }).waitFor();
    await measure(visitor.page);
    await visitor.page.getByLabel('Name of measure 1').fill('3 ~ mine');
    await visitor.page.getByRole('button', { name: 'Share' }).click();
    const link = await visitor.page.getByLabel('Link to this view').inputValue();
    await visitor.page.getByLabel('With my measures').uncheck();
    expect(await visitor.page.getByLabel('Link to this view').inputValue()).not.toContain(
      'measure',
    );
    const guest = await open(`${link}&measure=1,2&token=${access_token('viewer')}`, windows.phone);
    await guest.page.getByText('A measure cannot be read: measure[1].marks').waitFor();
    expect(await guest.page.getByLabel('Name of measure 1').inputValue()).toBe('3 ~ mine');
    await guest.page.getByRole('button', { name: 'The gate' }).waitFor();
    await settle(guest.page);
    await keep_screenshot(guest.page, 'measures-of-link');
    expect([...visitor.errors, ...guest.errors]).toEqual([]);
  });

  it('takes back every edit, and keeps the focus where it works', async () => {
    const { page } = await open_as('author', '?author');
    await page.getByText('About the scene').waitFor();
    const undo = page.getByRole('button', { name: 'Undo' });
    expect(await undo.isDisabled()).toBe(true);
    await page.getByRole('button', { name: 'New tour' }).click();
    await page.keyboard.type('Second');
    const add = page.getByRole('button', { name: 'Add a stop here' });
    for (const n of [1, 2, 3]) {
      await add.click();
      await page.getByLabel(`Title of stop ${n}`).waitFor();
    }
    const focused = (): Promise<string | null> =>
      page.evaluate(
        () =>
          document.activeElement!.getAttribute('aria-label') ?? document.activeElement!.textContent,
      );
    await page.getByRole('button', { name: 'Move stop 3 up' }).press('Enter');
    expect(await focused()).toBe('Move stop 2 up');
    await page.keyboard.press('Enter');
    expect(await focused()).toBe('Title of stop 1'); // there is nothing above it
    await page.getByLabel('Stay, s (1)').fill('7.5');
    await page.getByLabel('Flight, s (1)').fill('-1'); // no time
    await page.getByRole('button', { name: 'No hotspot' }).first().press('Enter');
    expect(await focused()).toBe('Hotspot here');
    await page.getByRole('button', { name: 'Delete stop 1' }).press('Enter');
    expect(await focused()).toBe('Delete stop 1');
    await undo.click();
    expect(await page.getByLabel('Stay, s (1)').inputValue()).toBe('7.5');
    expect(await page.getByLabel('Flight, s (1)').inputValue()).toBe('');
    for (let i = 0; i < 20 && (await undo.isEnabled()); ++i) await undo.click();
    expect(await undo.isEnabled()).toBe(false);
    expect(await page.getByLabel('Title of the tour', { exact: true }).inputValue()).not.toBe(
      'Second',
    );
  });

  it('is back where a preview began, by Escape and at its end', async () => {
    const { page } = await open_as('author', '?author', { viewport: { width: 1000, height: 640 } });
    await page.getByRole('button', { name: 'New tour' }).click();
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByLabel('Stay, s (1)').fill('0.5');
    await page.getByLabel('Flight, s (1)').fill('0.2');
    await page.mouse.move(300, 200);
    const at_stop = await pose_of(page);
    await page.mouse.wheel(0, -300);
    // A busy page hears of a wheel later than of a question.
    await expect.poll(async () => distance(at_stop, await pose_of(page))).toBeGreaterThan(0.1);
    await settle(page);
    const before = await pose_of(page);
    const panel = page.locator('#author-panel');
    const preview = page.getByRole('button', { name: 'Preview' });
    await preview.click();
    await page.locator('#tour').waitFor(); // there is no room for it beside the panel
    expect(await panel.isHidden()).toBe(true);
    await panel.waitFor();
    expect(distance(before, await pose_of(page))).toBeLessThan(1e-3);
    await page.getByLabel('Title of stop 1').focus();
    await page.getByLabel('Stay, s (1)').fill('3600');
    await preview.click();
    await page.getByRole('button', { name: 'Pause the tour' }).waitFor();
    await page.keyboard.press('Escape');
    await panel.waitFor();
    expect(distance(before, await pose_of(page))).toBeLessThan(1e-3);
    expect(await page.evaluate(() => document.activeElement?.id)).toBe('author-preview');
  });

  it('saves what was added right before, however late the server answers', async () => {
    const port = await start_delay_proxy(workshop.port, 300);
    const address = `http://127.0.0.1:${port}/?author#token=${access_token('author')}`;
    const { page } = await open(address, windows.desktop);
    await page.getByRole('region', { name: 'Make a tour' }).waitFor();
    const stops = page.locator('#author-stops > li');
    const before = await stops.count();
    const count_of = (json: string): number =>
      (JSON.parse(json) as { tours: { stops: unknown[] }[] }).tours[0]!.stops.length;
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors see it').waitFor();
    expect(count_of(readFileSync(sidecar, 'utf8'))).toBe(before + 1);
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByRole('button', { name: 'Download the file' }).click();
    expect(count_of(readFileSync(await (await download).path(), 'utf8'))).toBe(before + 2);
  });

  it('learns when another one saved meanwhile, and replaces that version on purpose only', async () => {
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
    await first.getByText('Saved. Visitors see it').waitFor();
    const replace = second.getByRole('button', { name: 'Replace the other version' });
    expect(await replace.isHidden()).toBe(true);
    await edit(second, 'By the second');
    await second.getByText('Not saved: someone else has saved this scene').waitFor();
    await keep_screenshot(second, 'author-changed-meanwhile');
    expect(readFileSync(sidecar, 'utf8')).toContain('By the first');
    await replace.click();
    await second.getByText('Saved. Visitors see it').waitFor();
    expect(await replace.isHidden()).toBe(true);
    expect(readFileSync(sidecar, 'utf8')).toContain('By the second');
    await edit(second, 'By the second again');
    await second.getByText('Saved. Visitors see it').waitFor();
    await edit(first, 'By the first again');
    await first.getByText('Not saved: someone else has saved this scene').waitFor();
  });

  it('whose link is a plain one saves a file, and learns how it gets to visitors', async () => {
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
    await page.getByText('open an author link').waitFor();
  });

  const rooms = {
    phone: windows.phone,
    'desktop-dark': windows['desktop-dark'],
    small: { viewport: { width: 1000, height: 620 } },
    narrow: { viewport: { width: 320, height: 640 } },
  };

  it.each(Object.entries(rooms))('has room to see and to write: %s', async (name, options) => {
    const { page } = await open_as('author', '?author', options);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await settle(page);
    await keep_screenshot(page, `author-${name}`);
    const rect = (selector: string): Promise<DOMRect> =>
      page.evaluate(
        (found) => document.querySelector(found)!.getBoundingClientRect().toJSON() as DOMRect,
        selector,
      );
    const { width, height } = options.viewport;
    const panel = await rect('#author-panel');
    expect(panel.bottom).toBeLessThanOrEqual(height);
    if (width < 800) expect(panel.top).toBeGreaterThan(0.4 * height);
    // Everything can be reached, and nothing is cut off at a side.
    for (const id of ['author-save', 'author-new', 'author-add', 'author-undo']) {
      await page.locator(`#${id}`).scrollIntoViewIfNeeded();
      const { left, right, bottom } = await rect(`#${id}`);
      expect([left >= panel.left, right <= panel.right, bottom <= panel.bottom + 1], id).toEqual([
        true,
        true,
        true,
      ]);
    }
  });
});
