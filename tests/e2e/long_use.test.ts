// Memory of the page and its worker while somebody uses them. Every test run takes half a minute;
// CATGS_USE_MINUTES=10 takes more. V8's total includes compiled code, which comes and goes. The memory
// that scripts hold must not grow.
import { expect, it } from 'vitest';
import type { Page, Worker } from 'playwright-core';
import { open } from './support/browser';
import {
  bytes_of,
  heap_bytes,
  heap_of_page,
  heap_of_worker,
  held_by_scripts,
  what_grew,
  type HeapOwner,
  type Held,
} from './support/heap';
import { start_server } from './support/programs';

const minutes = Number(process.env['CATGS_USE_MINUTES'] ?? '0.5');
const looks = Math.max(3, Math.ceil(minutes));

// Half a minute shows at most 600 pictures and ten minutes twenty times as many. So this is a hundred bytes
// a picture in half a minute and five in ten. The statistics of two minutes take half of it.
const most_growth_bytes = 64_000;

/** Turns, flies, opens and closes every panel, and changes the size, at least once. Returns how often. */
async function use(page: Page, duration_ms: number): Promise<number> {
  const end_ms = Date.now() + duration_ms;
  let round = 0;
  do {
    await page.mouse.move(200, 180);
    await page.mouse.down();
    await page.mouse.move(420, 200, { steps: 20 });
    await page.mouse.up();
    for (const key of ['KeyM', 'KeyW', 'KeyD', 'ArrowLeft', 'KeyI', 'KeyH', 'Escape', 'KeyR']) {
      await page.keyboard.press(key, { delay: 40 });
    }
    await page.setViewportSize({ width: 640, height: round % 2 === 0 ? 360 : 400 });
    await page.waitForTimeout(200);
    round += 1;
  } while (Date.now() < end_ms);
  return round;
}

interface Made {
  VideoDecoder: number;
  WebSocket: number;
}

/** Counts the decoders and the connections that the worker makes from now on. */
async function count_made(worker: Worker): Promise<() => Promise<Made>> {
  await worker.evaluate(() => {
    const scope = globalThis as unknown as {
      made: Made;
      VideoDecoder: typeof VideoDecoder;
      WebSocket: typeof WebSocket;
    };
    scope.made = { VideoDecoder: 0, WebSocket: 0 };
    scope.VideoDecoder = class extends scope.VideoDecoder {
      constructor(init: VideoDecoderInit) {
        super(init);
        scope.made.VideoDecoder += 1;
      }
    };
    scope.WebSocket = class extends scope.WebSocket {
      constructor(url: string | URL, protocols?: string | string[]) {
        super(url, protocols);
        scope.made.WebSocket += 1;
      }
    };
  });
  return () => worker.evaluate(() => (globalThis as unknown as { made: Made }).made);
}

/** A heap that is measured now and then. */
class Watched {
  private readonly used_: number[] = [];
  private readonly held_: Held[] = [];

  constructor(
    private readonly name_: string,
    private readonly heap_: HeapOwner,
  ) {}

  async look(): Promise<void> {
    this.used_.push(await heap_bytes(this.heap_));
    this.held_.push(await held_by_scripts(this.heap_));
  }

  growth_bytes(): number {
    return bytes_of(this.held_.at(-1)!) - bytes_of(this.held_[0]!);
  }

  report(): string {
    const series = (values: readonly number[]): string =>
      values.map((value) => (value / 1e6).toFixed(3)).join(' ');
    return [
      `heap of the ${this.name_} over ${minutes} min: ${series(this.used_)} MB,`,
      `of these held by scripts: ${series(this.held_.map(bytes_of))} MB;`,
      `most grew: ${what_grew(this.held_[0]!, this.held_.at(-1)!)}`,
    ].join('\n  ');
  }
}

it(
  'memory stays as it is',
  async () => {
    const server = await start_server('synth:garden:20000', ['--min-fps', '0']);
    const { page, errors } = await open(server.url);
    const devtools = await page.context().newCDPSession(page);
    const heaps = {
      page: new Watched('page', heap_of_page(devtools)),
      worker: new Watched('worker', await heap_of_worker(devtools)),
    };
    const made = await count_made(page.workers()[0]!);
    await use(page, 5000); // lets the page make what it makes once
    let rounds = 0;
    for (let i = 0; i < looks; ++i) {
      // The time of a measurement does not count as use, however long a busy machine takes.
      rounds += await use(page, (minutes * 60_000) / looks);
      for (const heap of Object.values(heaps)) await heap.look();
    }
    for (const heap of Object.values(heaps)) {
      console.log(heap.report());
      expect(heap.growth_bytes(), heap.report()).toBeLessThan(most_growth_bytes);
    }
    // Pictures changed their size at each stop, and the same decoder went on. A connection that a busy
    // machine lost needs a new one.
    const { VideoDecoder: decoders, WebSocket: connections } = await made();
    console.log(
      `${rounds} rounds of use; made anew: ${decoders} decoders, ${connections} connections`,
    );
    expect(decoders).toBeLessThanOrEqual(connections);
    expect(errors).toEqual([]);
  },
  minutes * 60_000 + 300_000,
);
