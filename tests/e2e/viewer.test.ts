// The client against the real server: what visitors do, and what happens when things fail.
import { execFileSync } from 'node:child_process';
import { cpSync, mkdtempSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Browser, BrowserContextOptions, Page } from 'playwright-core';
import { afterAll, afterEach, beforeAll, describe, expect, it } from 'vitest';
import type { Pose } from '#client/camera/eye';
import type { StatsSnapshot } from '#client/stats/metrics';
import {
  choose_full_size,
  close_pages,
  insecure_host,
  keep_screenshot,
  launch_browser,
  new_page,
  type WatchedPage,
} from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { web_dist } from './support/fake_server';
import { psnr_db, settled_picture, thumbnail } from './support/pictures';
import { catgs_render, start_server, stop_servers, type RunningServer } from './support/programs';
import { scratch_folder } from './support/scenes';

const { folder, remove } = scratch_folder();
const scene = path.join(folder, 'city.ply');

let browser: Browser;
let server: RunningServer;

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '30000');
  browser = await launch_browser();
  server = await start_server(scene);
});

afterEach(close_pages);

afterAll(async () => {
  await browser.close();
  await server.stop();
  await stop_servers();
  remove();
});

async function open_viewer(options?: BrowserContextOptions, url = server.url): Promise<WatchedPage> {
  const watched = await new_page(browser, options);
  await watched.page.goto(url);
  return watched;
}

const stats_of = (page: Page): Promise<StatsSnapshot> => page.evaluate(() => window.catgs!.stats());

const patience = { timeout: 60_000, interval: 100 };

/** Waits until `count` more frames have been shown. */
async function more_frames(page: Page, count: number): Promise<void> {
  const { frames_shown } = await stats_of(page);
  const goal = frames_shown + count;
  await expect
    .poll(async () => (await stats_of(page)).frames_shown, patience)
    .toBeGreaterThanOrEqual(goal);
}

const rounded = (_key: string, value: unknown): unknown =>
  typeof value === 'number' ? Math.round(value * 10) / 10 : value;

async function size_of(page: Page): Promise<[number, number]> {
  const { width_px, height_px } = await stats_of(page);
  return [width_px, height_px];
}

/** Angle between two orientations, rad. */
function turned(a: Pose, b: Pose): number {
  const dot = a.orientation.reduce((sum, v, i) => sum + v * b.orientation[i]!, 0);
  return 2 * Math.acos(Math.min(1, Math.abs(dot)));
}

describe('a visit', () => {
  it('shows a moving picture, with video, without an error', async () => {
    const { page, errors } = await open_viewer();
    await choose_full_size(page);
    const first = await settled_picture(page);
    expect([first.width, first.height]).toEqual([640, 360]);
    await page.keyboard.down('ArrowRight');
    await more_frames(page, 20);
    await page.keyboard.up('ArrowRight');
    // A still picture comes back at 47 dB. On a busy machine the ladder may have gone down meanwhile.
    const later = await settled_picture(page);
    if (later.width === first.width) expect(psnr_db(first, later)).toBeLessThan(38);
    else expect(later.width).toBeLessThan(first.width);
    await page.keyboard.press('KeyI');
    const panel = page.locator('#stats-panel');
    await panel.getByText(/libx264/).waitFor();
    await panel.getByText(/CPU|CUDA/).waitFor();
    expect(await panel.innerText()).toMatch(/640 × 360|480 × 270|320 × 180/);
    await expect.poll(() => panel.locator('.uplot canvas').count(), patience).toBe(3);
    const download = page.waitForEvent('download');
    await panel.getByRole('button', { name: 'Save as JSON' }).click();
    const saved = JSON.parse(readFileSync(await (await download).path(), 'utf8')) as {
      renderer: string;
      samples: { time_s: number; stats: StatsSnapshot }[];
    };
    expect(saved.renderer).toMatch(/CPU|CUDA/);
    expect(saved.samples[0]!.stats.frames_shown).toBeGreaterThan(20);
    await keep_screenshot(page, 'visit');
    expect(errors).toEqual([]);
  });

  it('goes where mouse, wheel and keys say', async () => {
    const { page } = await open_viewer();
    await settle(page);
    const start = await pose_of(page);
    const drag = async (button: 'left' | 'right'): Promise<void> => {
      await page.mouse.move(320, 180);
      await page.mouse.down({ button });
      await page.mouse.move(400, 200, { steps: 4 });
      await page.mouse.up({ button });
      await settle(page);
    };
    await drag('left');
    const orbited = await pose_of(page);
    expect(turned(start, orbited)).toBeGreaterThan(0.2);
    await drag('right');
    const panned = await pose_of(page);
    expect(turned(orbited, panned)).toBeCloseTo(0, 3);
    expect(distance(orbited, panned)).toBeGreaterThan(0);
    await page.mouse.wheel(0, -300);
    await expect.poll(async () => distance(panned, await pose_of(page)), patience).toBeGreaterThan(0);
    await settle(page);
    const closer = await pose_of(page);
    expect(turned(panned, closer)).toBeCloseTo(0, 6);
    await page.keyboard.press('KeyM');
    await page.getByText('Fly', { exact: true }).waitFor();
    await page.keyboard.press('KeyR');
    await settle(page);
    expect(distance(start, await pose_of(page))).toBeCloseTo(0, 6);
    await page.keyboard.down('KeyW');
    await page.waitForFunction(
      (z) => window.catgs!.pose().position.some((v, i) => v !== z[i]),
      start.position,
    );
    await page.keyboard.up('KeyW');
  });

  it('goes where fingers say', async () => {
    const { page } = await open_viewer({
      viewport: { width: 390, height: 640 },
      hasTouch: true,
      isMobile: true,
    });
    await settle(page);
    const touch = await page.context().newCDPSession(page);
    const fingers = async (path_of: (t: number) => { x: number; y: number }[]): Promise<void> => {
      await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: path_of(0) });
      for (const t of [0.25, 0.5, 0.75, 1]) {
        await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: path_of(t) });
      }
      await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
      await settle(page);
    };
    const start = await pose_of(page);
    await fingers((t) => [{ x: 150 + 80 * t, y: 300 }]);
    const looked = await pose_of(page);
    expect(turned(start, looked)).toBeGreaterThan(0.1);
    await fingers((t) => [
      { x: 150 - 60 * t, y: 300 },
      { x: 240 + 60 * t, y: 300 },
    ]);
    const pinched = await pose_of(page);
    expect(turned(looked, pinched)).toBeCloseTo(0, 2);
    expect(distance(looked, pinched)).toBeGreaterThan(0);
    await keep_screenshot(page, 'phone');
  });

  it('asks for the size that the view and the quality menu say', async () => {
    const { page } = await open_viewer();
    await choose_full_size(page);
    await settle(page);
    await page.setViewportSize({ width: 800, height: 450 });
    await expect.poll(() => size_of(page), patience).toEqual([800, 450]);
    await page.getByRole('button', { name: 'Quality and view' }).click();
    await page.getByLabel('Picture').selectOption('240');
    await expect.poll(() => size_of(page), patience).toEqual([426, 240]);
    const picture = await settled_picture(page);
    expect([picture.width, picture.height]).toEqual([426, 240]);
  });

  it('reports how the demo city moves at 640x360', async () => {
    const demo = await start_server('synth:city:300000');
    const { page } = await open_viewer(undefined, demo.url);
    await settle(page);
    await choose_full_size(page);
    await page.keyboard.down('ArrowRight');
    await more_frames(page, 120);
    const stats = await stats_of(page);
    await page.keyboard.up('ArrowRight');
    await demo.stop();
    const { motion_to_photon_ms: motion, pose_age_ms: age } = stats;
    console.log(
      `${stats.fps_shown.toFixed(1)} fps shown; ` +
        `motion to photon p50 ${motion.p50.toFixed(0)} ms, p95 ${motion.p95.toFixed(0)} ms; ` +
        `pose age p50 ${age.p50.toFixed(0)} ms, p95 ${age.p95.toFixed(0)} ms; ` +
        `stages ${JSON.stringify(stats.stages_ms, rounded)} ms`,
    );
    // Where other tests keep the machine busy, the ladder may have gone down a rung or two.
    const rungs = [1, 3 / 4, 1 / 2].map((scale) => [640 * scale, 360 * scale]);
    expect(rungs).toContainEqual([stats.width_px, stats.height_px]);
    expect(motion.p50).toBeGreaterThan(0);
    expect(motion.p95).toBeGreaterThanOrEqual(motion.p50);
    expect(age.p95).toBeGreaterThan(0);
  });
});

/** A copy of the client whose worker begins with this. */
function client_with(prelude: string): string {
  const copy = mkdtempSync(path.join(folder, 'client-'));
  cpSync(web_dist, copy, { recursive: true });
  const assets = path.join(copy, 'assets');
  const worker = readdirSync(assets).find((name) => name.startsWith('worker-'))!;
  const file = path.join(assets, worker);
  writeFileSync(file, `${prelude}\n${readFileSync(file, 'utf8')}`);
  return copy;
}

describe('trouble', () => {
  it('a server that crashed and came back is found again, without a reload, at the same place', async () => {
    const first = await start_server(scene);
    const { page } = await open_viewer(undefined, first.url);
    await choose_full_size(page);
    await settle(page);
    await page.evaluate(() => {
      document.body.dataset['visit'] = 'first';
      const { position, orientation } = window.catgs!.pose();
      window.catgs!.setPose({ position: [position[0] + 0.5, position[1], position[2]], orientation });
    });
    await settle(page);
    const before = await pose_of(page);
    const picture = await settled_picture(page);
    await first.stop('SIGKILL');
    await page.getByRole('button', { name: 'Try now' }).waitFor();
    await keep_screenshot(page, 'reconnecting');
    const second = await start_server(scene, ['--port', String(first.port)]);
    await more_frames(page, 1);
    expect(await pose_of(page)).toEqual(before);
    const again = await settled_picture(page);
    expect(psnr_db(thumbnail(picture), thumbnail(again))).toBeGreaterThan(30);
    expect(await page.evaluate(() => document.body.dataset['visit'])).toBe('first');
    expect(await page.locator('#card').isHidden()).toBe(true);
    await second.stop();
  });

  it('a refused token is said, a right one works, and neither stays in the address', async () => {
    const token_file = path.join(folder, 'token');
    writeFileSync(token_file, 'a-long-and-secret-token\n', { mode: 0o600 });
    const guarded = await start_server(scene, ['--token-file', token_file]);
    const { page } = await open_viewer(undefined, `${guarded.url}#token=wrong`);
    await page.getByText('Access token needed').waitFor();
    expect(page.url()).toBe(guarded.url);
    const { page: invited } = await open_viewer(
      undefined,
      `${guarded.url}#token=a-long-and-secret-token`,
    );
    await settle(invited);
    expect(invited.url()).toBe(guarded.url);
    await invited.reload();
    await settle(invited);
    // Links that are pasted into a tab that shows the page.
    const paste = async (into: Page, token: string): Promise<void> => {
      const loaded = into.waitForEvent('load');
      await into.goto(`${guarded.url}#token=${token}`);
      await loaded;
    };
    await paste(page, 'a-long-and-secret-token');
    await settle(page);
    expect(page.url()).toBe(guarded.url);
    await paste(invited, 'wrong');
    await invited.getByText('Access token needed').waitFor();
    expect(guarded.log()).not.toContain('a-long-and-secret-token');
    await guarded.stop();
  });

  it('a certificate of one\'s own is enough for video under another name', async () => {
    const [cert, key] = ['cert.pem', 'key.pem'].map((name) => path.join(folder, name)) as [string, string];
    execFileSync(
      'openssl',
      [
        ...['req', '-x509', '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes'],
        ...['-days', '2', '-subj', '/CN=catgs', '-keyout', key, '-out', cert],
      ],
      { stdio: 'ignore' },
    );
    const secure = await start_server(scene, [
      ...['--tls-cert', cert, '--tls-key', key, '--allow-origin', `https://${insecure_host}`],
    ]);
    const { page, errors } = await open_viewer(
      { viewport: { width: 640, height: 360 }, ignoreHTTPSErrors: true },
      secure.url.replace('127.0.0.1', insecure_host),
    );
    await settle(page);
    expect(page.url()).toMatch(/^https:/);
    await page.keyboard.press('KeyI');
    await page.locator('#stats-panel').getByText(/libx264/).waitFor();
    expect(await page.locator('#notice').isHidden()).toBe(true);
    expect(errors).toEqual([]);
    await secure.stop();
  });

  it('a visitor without a place waits in line, with the scene in view, and gets in', async () => {
    const small = await start_server(scene, ['--max-sessions', '1']);
    const { page: first } = await open_viewer(undefined, small.url);
    await settle(first);
    const { page: second } = await open_viewer({ viewport: { width: 1280, height: 720 } }, small.url);
    await second.getByText('Number 1 in the queue').waitFor();
    await second.locator('#poster').waitFor();
    await keep_screenshot(second, 'queue');
    await first.close();
    await settle(second);
    expect(await second.locator('#card').isHidden()).toBe(true);
    await expect.poll(() => second.locator('#poster').isHidden(), patience).toBe(true);
    await small.stop();
  });

  it('a hidden page gets no pictures, and the newest one when it is seen again', async () => {
    const { page } = await open_viewer();
    await settle(page);
    const show = (hidden: boolean): Promise<void> =>
      page.evaluate((value) => {
        Object.defineProperty(document, 'hidden', { get: () => value, configurable: true });
        document.dispatchEvent(new Event('visibilitychange'));
      }, hidden);
    await show(true);
    await page.waitForTimeout(500); // what was under way arrives
    const { frames_shown } = await stats_of(page);
    await page.evaluate(() => {
      const { position, orientation } = window.catgs!.pose();
      window.catgs!.setPose({ position: [position[0] + 1, position[1], position[2]], orientation });
    });
    await page.waitForTimeout(1500);
    expect((await stats_of(page)).frames_shown).toBe(frames_shown);
    await show(false);
    await settle(page);
    const { x } = (await page.evaluate(() => window.catgs!.snapshot())).header.renderPose!.position!;
    expect(x).toBeCloseTo((await pose_of(page)).position[0], 3);
  });

  it('a page that is no secure context gets JPEG pictures and says how to get video', async () => {
    // The server answers to another host name only when it was told that name.
    const plain = await start_server(scene, ['--allow-origin', `http://${insecure_host}`]);
    const { page } = await open_viewer(undefined, plain.url.replace('127.0.0.1', insecure_host));
    await page.getByText('browsers offer their video decoder (WebCodecs) on https://').waitFor();
    await choose_full_size(page);
    const picture = await settled_picture(page);
    expect([picture.width, picture.height]).toEqual([640, 360]);
    await page.getByRole('button', { name: 'Dismiss' }).click();
    await page.keyboard.press('KeyI');
    await page.locator('#stats-panel').getByText(/jpeg/).waitFor();
    await plain.stop();
  });

  it.each([
    ['the hardware', "configuration.hardwareAcceleration !== 'prefer-software'", 'prefer-software'],
    ['any', 'true', 'jpeg'],
  ])('%s video decoder that fails is replaced, and remembered', async (_which, fails, rung) => {
    const faulty = await start_server(scene, ['--client-dir', client_with(`
      self.VideoDecoder = class extends VideoDecoder {
        configure(configuration) {
          this.fails = ${fails};
          super.configure(configuration);
        }
        decode(chunk) {
          if (this.fails) throw new DOMException('injected', 'EncodingError');
          super.decode(chunk);
        }
      };`)]);
    const watched = await new_page(browser);
    const { page } = watched;
    const warnings: string[] = [];
    page.on('console', (message) => warnings.push(message.text()));
    const decoder_failures = (): number =>
      warnings.filter((text) => text.includes('video decoder failed')).length;
    await page.goto(faulty.url);
    await settle(page);
    expect(decoder_failures()).toBeGreaterThanOrEqual(2);
    expect(await page.evaluate(() => localStorage.getItem('catgs.decoder'))).toContain(rung);
    if (rung === 'jpeg') await page.getByText('pictures come as JPEG').waitFor();
    warnings.length = 0;
    await page.reload();
    await settle(page);
    expect(decoder_failures()).toBe(0);
    await page.keyboard.press('KeyI');
    await page
      .locator('#stats-panel')
      .getByText(rung === 'jpeg' ? /jpeg/ : /libx264/)
      .waitFor();
    await faulty.stop();
  });

  it('an unknown scene is said, and the ones there are', async () => {
    const { page } = await open_viewer(undefined, `${server.url}?scene=atlantis`);
    await page.getByText('No such scene').waitFor();
    await page.getByRole('button', { name: 'Open city' }).click();
    await settle(page);
  });
});
