// Memory of the page and of its worker while somebody uses it: half a minute of it in every test run,
// CATGS_USE_MINUTES=10 for more.
import { afterAll, beforeAll, expect, it } from 'vitest';
import type { Browser, Page, Worker } from 'playwright-core';
import { launch_browser, new_page } from './support/browser';
import { settle } from './support/camera';
import { attach_to_worker, heap_bytes, type SendCommand } from './support/heap';
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

/** Counts the video decoders that the worker makes from now on. */
async function count_decoders(worker: Worker): Promise<() => Promise<number>> {
  await worker.evaluate(() => {
    const scope = globalThis as unknown as { made: number; VideoDecoder: typeof VideoDecoder };
    scope.made = 0;
    scope.VideoDecoder = class extends scope.VideoDecoder {
      constructor(init: VideoDecoderInit) {
        super(init);
        scope.made += 1;
      }
    };
  });
  return () => worker.evaluate(() => (globalThis as unknown as { made: number }).made);
}

it(
  'memory stays as it is',
  async () => {
    const { page, errors } = await new_page(browser);
    await page.goto(server.url);
    await settle(page);
    const devtools = await page.context().newCDPSession(page);
    const heaps: Record<string, { send: SendCommand; bytes: number[] }> = {
      page: { send: (method) => devtools.send(method as 'HeapProfiler.enable'), bytes: [] },
      worker: { send: await attach_to_worker(devtools), bytes: [] },
    };
    const decoders_made = await count_decoders(page.workers()[0]!);
    await use(page, Date.now() + 5000); // what is made once is made
    const begin = Date.now();
    for (let i = 1; i <= looks; ++i) {
      await use(page, begin + (i * minutes * 60_000) / looks);
      for (const heap of Object.values(heaps)) heap.bytes.push(await heap_bytes(heap.send));
    }
    for (const [name, { bytes }] of Object.entries(heaps)) {
      const steps = bytes.map((value) => (value / 1e6).toFixed(2)).join(' ');
      console.log(`heap of the ${name} over ${minutes} min: ${steps} MB`);
      // Two kilobytes a frame would show in half a minute, a hundred bytes in ten.
      expect(bytes[looks - 1]! - bytes[0]!).toBeLessThan(1e6);
    }
    // Pictures changed their size at each stop: the decoder was told, not replaced.
    expect(await decoders_made()).toBe(0);
    expect(errors).toEqual([]);
  },
  minutes * 60_000 + 120_000,
);
