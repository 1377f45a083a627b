// One of two servers behind HAProxy ends. Its visitor moves to the other one over a second
// connection and does not notice.
import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { beforeAll, expect, it } from 'vitest';
import type { Page } from 'playwright-core';
import { open } from './support/browser';
import { start_haproxy } from './support/haproxy';
import { catgs_render, start_server, type RunningServer } from './support/programs';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'city.ply');

let servers: RunningServer[];
let proxy: string; // its address

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '30000');
  const key_file = path.join(folder, 'key');
  writeFileSync(key_file, 'k'.repeat(32), { mode: 0o600 });
  // The runbook asks for longer than the proxy takes to see /readyz fail.
  const options = [
    ...['--resume-key-file', key_file, '--trusted-proxy', '127.0.0.1'],
    ...['--drain-wait', '4', '--drain-deadline', '20'],
  ];
  servers = await Promise.all([start_server(scene, options), start_server(scene, options)]);
  proxy = await start_haproxy(
    folder,
    servers.map((server) => server.port),
  );
});

/** Watches every refresh of the page. Keeps the longest time without a new picture, and the messages. */
function watch_pictures(page: Page): Promise<void> {
  return page.evaluate(() => {
    const seen = { shown: 0, changed_at: performance.now(), longest_ms: 0, cards: 0 };
    (window as unknown as { seen: typeof seen }).seen = seen;
    const look = async (): Promise<void> => {
      const { frames_shown } = await window.catgs!.stats();
      const now = performance.now();
      seen.longest_ms = Math.max(seen.longest_ms, now - seen.changed_at);
      if (frames_shown !== seen.shown) {
        seen.shown = frames_shown;
        seen.changed_at = now;
      }
      if (!document.querySelector('#card')!.hasAttribute('hidden')) seen.cards += 1;
      requestAnimationFrame(() => void look());
    };
    void look();
  });
}

const watched = (page: Page): Promise<{ shown: number; longest_ms: number; cards: number }> =>
  page.evaluate(
    () =>
      (window as unknown as { seen: { shown: number; longest_ms: number; cards: number } }).seen,
  );

it('a visitor of a server that drains continues at the other one', async () => {
  const { page, errors } = await open(proxy);
  const session = /session (\w+): \S+ looks at/;
  const from = servers.find((server) => session.test(server.log()))!;
  const to = servers.find((server) => server !== from)!;
  const id = session.exec(from.log())![1]!;
  expect(session.test(to.log())).toBe(false);

  await page.evaluate(() => (document.body.dataset['visit'] = 'first'));
  await page.keyboard.down('ArrowRight');
  await watch_pictures(page);
  await expect.poll(async () => (await watched(page)).shown).toBeGreaterThan(10);
  const ended = from.stop('SIGTERM');
  await expect.poll(() => session.exec(to.log())?.[1]).toBe(id);
  await ended;
  const moved = await watched(page);
  await expect.poll(async () => (await watched(page)).shown).toBeGreaterThan(moved.shown + 20);
  await page.keyboard.up('ArrowRight');

  const { longest_ms, cards } = await watched(page);
  console.log(`longest time without a new picture, over the drain: ${Math.round(longest_ms)} ms`);
  expect(cards).toBe(0);
  expect(await page.evaluate(() => document.body.dataset['visit'])).toBe('first');
  // It left by itself, before the deadline would have closed it.
  expect(from.log()).toContain('stopped');
  expect(from.log()).not.toContain('deadline');
  expect(errors).toEqual([]);
});
