// Memory of the page while somebody uses it: half a minute of it in every test run,
// CATGS_USE_MINUTES=10 for more.
import { afterAll, beforeAll, expect, it } from 'vitest';
import type { Browser, Page } from 'playwright-core';
import { launch_browser, new_page } from './support/browser';
import { settle } from './support/camera';
import { start_server, stop_servers, type RunningServer } from './support/programs';

const minutes = Number(process.env['CATGS_USE_MINUTES'] ?? '0.5');
const looks = 6;

let browser: Browser;
let server: RunningServer;

beforeAll(async () => {
  browser = await launch_browser();
  server = await start_server('synth:city:20000', ['--min-fps', '0']);
});

afterAll(async () => {
  await browser.close();
  await stop_servers();
});

/** Turns, flies, opens and closes what there is, changes size. */
async function use(page: Page, until_ms: number): Promise<void> {
  for (let round = 0; Date.now() < until_ms; ++round) {
    await page.mouse.move(200, 180);
    await page.mouse.down();
    await page.mouse.move(420, 200, { steps: 20 });
    await page.mouse.up();
    for (const key of ['KeyM', 'KeyW', 'KeyD', 'ArrowLeft', 'KeyI', 'KeyH', 'Escape', 'KeyR']) {
      await page.keyboard.press(key, { delay: 40 });
    }
    await page.setViewportSize({ width: 640, height: round % 2 === 0 ? 360 : 400 });
    await page.waitForTimeout(200);
  }
}

it(
  'memory stays as it is',
  async () => {
    const { page, errors } = await new_page(browser);
    await page.goto(server.url);
    await settle(page);
    const devtools = await page.context().newCDPSession(page);
    const heap_bytes = async (): Promise<number> => {
      await devtools.send('HeapProfiler.collectGarbage');
      return (await devtools.send('Runtime.getHeapUsage')).usedSize;
    };
    await use(page, Date.now() + 5000); // what is made once is made
    const begin = Date.now();
    const heaps: number[] = [];
    for (let i = 1; i <= looks; ++i) {
      await use(page, begin + (i * minutes * 60_000) / looks);
      heaps.push(await heap_bytes());
    }
    console.log(`page heap over ${minutes} min: ${heaps.map((b) => (b / 1e6).toFixed(2)).join(' ')} MB`);
    // Two kilobytes a frame would show in half a minute, a hundred bytes in ten.
    expect(heaps[looks - 1]! - heaps[0]!).toBeLessThan(1e6);
    expect(errors).toEqual([]);
  },
  minutes * 60_000 + 120_000,
);
