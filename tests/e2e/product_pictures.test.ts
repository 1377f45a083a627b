// README shows these: a picture of each feature on the demo scenes. CATGS_PICTURES=deploy/media keeps them there.
import { mkdirSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, expect, it } from 'vitest';
import { in_page, open, new_page } from './support/browser';
import { settle } from './support/camera';
import { artefacts, source_dir } from './support/paths';
import {
  access_token,
  catgs_render,
  start_server,
  type RunningServer,
  with_tokens,
} from './support/programs';
import { make_demo, scratch_folder } from './support/scenes';
import { present } from './support/shared_tour';

const window_size = { viewport: { width: 960, height: 600 } };
const shown_width = 640; // in README
const most_bytes = 60_000;
const folder = process.env['CATGS_PICTURES']
  ? path.join(source_dir, process.env['CATGS_PICTURES'])
  : artefacts;

let server: RunningServer;

beforeAll(async () => {
  const city = make_demo(scratch_folder());
  catgs_render('floors', city, city.replace('.ply', '.walk'));
  const garden = city.replace('city', 'garden');
  server = await start_server(city, [
    '--scene',
    garden,
    '--min-fps',
    '0',
    ...with_tokens,
    '--open',
  ]);
});

/** Keeps the page as a WebP file. */
async function keep(page: Page, name: string): Promise<void> {
  const png = `data:image/png;base64,${(await page.screenshot()).toString('base64')}`;
  const webp = await in_page((canvas_page) =>
    canvas_page.evaluate(
      async ([source, width]) => {
        const image = new Image();
        image.src = source;
        await image.decode();
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [width, (width * image.height) / image.width];
        const context = canvas.getContext('2d')!;
        context.imageSmoothingQuality = 'high';
        context.drawImage(image, 0, 0, canvas.width, canvas.height);
        return canvas.toDataURL('image/webp', 0.7).split(',')[1]!;
      },
      [png, shown_width] as const,
    ),
  );
  const bytes = Buffer.from(webp, 'base64');
  expect(bytes.length).toBeLessThan(most_bytes);
  mkdirSync(folder, { recursive: true });
  writeFileSync(path.join(folder, `${name}.webp`), bytes);
}

const address = (query = '', hash = ''): string => `${server.url}?scene=city${query}${hash}`;
const author = (): string => `#token=${access_token('author')}`;

async function go_to_stop(page: Page, n: number): Promise<void> {
  for (let i = 0; i < n; ++i) {
    await page.getByRole('button', { name: 'Next stop' }).click();
    await page.getByText(`${i + 1} of 6`).waitFor();
  }
  await settle(page);
}

/** On the street, where the first stop is. */
async function walk(page: Page): Promise<void> {
  await page.locator('#button-plan').waitFor({ state: 'visible' });
  await page.locator('#view').focus();
  for (let k = 0; k < 3 && (await page.locator('#mode-label').innerText()) !== 'Walk'; ++k)
    await page.keyboard.press('KeyM');
  await page.locator('#floor-ring').waitFor({ state: 'attached' });
  await settle(page);
  await page.mouse.move(250, 470); // beside the card of the stop
  await page.locator('#floor-ring.shown').waitFor();
  await settle(page);
}

const pictures: Readonly<Record<string, (page: Page) => Promise<void>>> = {
  walking: async (page) => {
    await page.goto(address());
    await go_to_stop(page, 1);
    await walk(page);
  },
  plan: async (page) => {
    await page.goto(address());
    await go_to_stop(page, 1);
    await page.locator('#button-plan').click();
    await page.locator('#plan-panel').getByRole('button', { name: 'Larger' }).click();
    const colours = (): Promise<number> =>
      page.locator('#plan-panel canvas').evaluate((canvas: HTMLCanvasElement) => {
        const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
        return new Set(new Uint32Array(data.buffer)).size;
      });
    await expect.poll(colours).toBeGreaterThan(20);
    await settle(page);
  },
  measuring: async (page) => {
    await page.goto(address());
    await settle(page);
    await page.locator('#button-measure').click();
    for (const x of [400, 560]) await page.locator('#view').click({ position: { x, y: 400 } });
    await expect.poll(() => page.locator('#measure-results dd').first().innerText()).toMatch(/\d/);
  },
  portals: async (page) => {
    await page.goto(address());
    await go_to_stop(page, 6);
    await page.locator('#tour-portal').waitFor();
  },
  media: async (page) => {
    await page.goto(address());
    await go_to_stop(page, 4);
    await page.locator('#tour img').first().waitFor();
  },
  languages: async (page) => {
    await page.goto(address('&lang=de'));
    await settle(page);
    await page.locator('#button-next, #tour-next').first().click();
    await page.getByText('1 von 6').waitFor();
    await settle(page);
  },
  presenting: async (page) => {
    await page.goto(address());
    await settle(page);
    const link = await present(page);
    await open(link, window_size);
    await page.getByText('You are presenting to one participant.').waitFor();
    await page.keyboard.press('Escape');
    await page.locator('#view').click({ position: { x: 700, y: 300 }, modifiers: ['Alt'] });
    await page.locator('.ping').first().waitFor({ state: 'attached' });
  },
  films: async (page) => {
    await page.goto(address('&author', author()));
    await settle(page);
    await page.getByText('Pictures and film').click();
    await page.getByLabel('Kind').selectOption('film');
    await page.getByRole('button', { name: 'Create' }).click();
    await page.getByText('rendered, about').waitFor();
  },
  counts: async (page) => {
    await page.goto(address('', author()));
    await settle(page);
    await page.goto(`${server.url}visits${author()}`);
    await page.getByText('City').or(page.getByText('city')).first().waitFor();
    await page.locator('canvas').first().waitFor();
    await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  },
};

it.each(Object.keys(pictures))('%s', async (name) => {
  const { page, errors } = await new_page(window_size);
  await pictures[name]!(page);
  await keep(page, name);
  expect(errors).toEqual([]);
});
