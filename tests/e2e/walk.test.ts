// Walking on the ground of a scene, and its floor plan, against the real server.
import { writeFileSync } from 'node:fs';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { dot, rotate, type Vec3 } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { barriers } from './support/axe';
import { keep_screenshot, open, windows } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { catgs_render, start_server, type RunningServer } from './support/programs';
import { make_streets, scratch_folder, write_room } from './support/scenes';

const folder = scratch_folder();
const eye_m = 1.6; // y points down, and the ground lies at 0
const street: Vec3 = [0, -eye_m, -8];

let scene: string;
let server: RunningServer;

beforeAll(async () => {
  const stop = (title: string, position: Vec3) => ({ title, position, look_at: [0, -1.6, 60] });
  const stops = [stop('The crossing', street), stop('Up the street', [0, -eye_m, 4])];
  scene = make_streets(folder, 'The streets', stops);
  catgs_render('floors', scene, path.join(folder, 'city.walk'), '--eye-height', String(eye_m));
  server = await start_server(scene, ['--min-fps', '0']);
});

/** Presses M until the visitor walks, and waits until they stand on the ground. */
async function walk(page: Page): Promise<Pose> {
  await page.locator('#button-plan').waitFor({ state: 'visible' });
  await page.locator('#view').focus();
  for (let k = 0; k < 3 && (await page.locator('#mode-label').innerText()) !== 'Walk'; ++k)
    await page.keyboard.press('KeyM');
  await page.locator('#floor-ring').waitFor({ state: 'attached' });
  await expect.poll(async () => (await pose_of(page)).position[1]).toBeGreaterThan(-eye_m - 0.3);
  await settle(page);
  return pose_of(page);
}

const height = ({ position }: Pose): number => -position[1];

describe('a visitor who walks', () => {
  it('comes down to the street, and passes no house', async () => {
    const { page, errors } = await open(server.url, windows.desktop);
    const begin = await walk(page);
    expect(height(begin)).toBeGreaterThan(eye_m - 0.3);
    await keep_screenshot(page, 'walk-street');
    // Sideways there are houses. Whoever flies passes them.
    await page.keyboard.down('ShiftLeft');
    await page.keyboard.down('KeyD');
    let before = begin;
    for (let k = 0; k < 24; ++k) {
      await page.waitForTimeout(250);
      const now = await pose_of(page);
      expect(Math.abs(height(now) - eye_m)).toBeLessThan(0.8);
      if (distance(before, now) < 1e-3 && k > 5) break;
      before = now;
    }
    await page.keyboard.up('KeyD');
    await page.keyboard.up('ShiftLeft');
    await settle(page);
    const at_wall = await pose_of(page);
    await page.keyboard.down('KeyD');
    await page.waitForTimeout(400);
    await page.keyboard.up('KeyD');
    await settle(page);
    const across = (a: Pose, b: Pose): number => {
      const right = rotate(a.orientation, [1, 0, 0]);
      return dot(right, [b.position[0] - a.position[0], 0, b.position[2] - a.position[2]]);
    };
    expect(across(begin, at_wall)).toBeGreaterThan(1);
    expect(across(at_wall, await pose_of(page))).toBeLessThan(0.6);
    expect(errors).toEqual([]);
  });

  it('walks to where they click, and stops for a key', async () => {
    const { page } = await open(server.url, windows.desktop);
    const begin = await walk(page);
    await page.mouse.move(640, 560);
    await page.locator('#floor-ring.shown').waitFor();
    await keep_screenshot(page, 'walk-ring');
    await page.mouse.click(640, 560);
    await expect.poll(async () => distance(begin, await pose_of(page))).toBeGreaterThan(0.5);
    await settle(page);
    const there = await pose_of(page);
    expect(Math.abs(height(there) - eye_m)).toBeLessThan(0.5);
    await page.mouse.click(640, 480);
    await expect.poll(async () => distance(there, await pose_of(page))).toBeGreaterThan(0.3);
    await page.keyboard.press('ArrowLeft');
    await settle(page);
    const stopped = await pose_of(page);
    await page.waitForTimeout(300);
    expect(distance(stopped, await pose_of(page))).toBeLessThan(0.05);
  });
});

describe('a visitor who stands where no floor is', () => {
  it('is told so until they walk', async () => {
    const { page } = await open(server.url, windows.desktop);
    await page.locator('#button-plan').waitFor({ state: 'visible' });
    await page.evaluate(() => (location.hash = 'at=0,-40,-90,0,0,0,1,60'));
    await settle(page);
    await page.locator('#view').focus();
    const notice = page.getByText('There is no floor here.');
    for (let k = 0; k < 3 && !(await notice.isVisible()); ++k) {
      await page.keyboard.press('KeyM');
      await page.waitForTimeout(500);
    }
    await notice.waitFor();
    await page.mouse.click(640, 600);
    await expect.poll(async () => height(await pose_of(page))).toBeLessThan(39);
    await notice.waitFor({ state: 'hidden', timeout: 2000 }); // it would go by itself after 10 s
  });
});

describe('a visit that begins inside', () => {
  const servers: Record<string, RunningServer> = {};
  beforeAll(async () => {
    for (const [name, sidecar] of [
      ['estimated', undefined],
      [
        'at eye height',
        {
          metres_per_unit: 1,
          start_pose: { position: [-2.5, -eye_m, -1.5], look_at: [3, -1.2, 1] },
        },
      ],
    ] as const) {
      const room = path.join(scratch_folder(), 'room.ply');
      write_room(room);
      if (sidecar) writeFileSync(room.replace('.ply', '.json'), JSON.stringify(sidecar));
      servers[name] = await start_server(room, ['--min-fps', '0', '--up', '-y']);
    }
  });
  const mode = (page: Page): Promise<string> => page.locator('#mode-label').innerText();
  /** By finger where the window has touch. */
  const drag = async (
    page: Page,
    { viewport, hasTouch }: { viewport: { width: number; height: number }; hasTouch?: boolean },
    by: readonly [number, number],
  ): Promise<void> => {
    const finger = await page.context().newCDPSession(page);
    const at = (k: number) => ({
      x: (viewport.width - by[0]) / 2 + (by[0] * k) / 6,
      y: (viewport.height - by[1]) / 2 + (by[1] * k) / 6,
    });
    const touch = (type: 'touchStart' | 'touchMove' | 'touchEnd', touchPoints: object[]) =>
      finger.send('Input.dispatchTouchEvent', { type, touchPoints: touchPoints as [] });
    if (hasTouch) await touch('touchStart', [at(0)]);
    else await page.mouse.move(at(0).x, at(0).y);
    if (!hasTouch) await page.mouse.down();
    for (let k = 1; k <= 6; ++k) {
      if (hasTouch) await touch('touchMove', [at(k)]);
      else await page.mouse.move(at(k).x, at(k).y);
    }
    if (hasTouch) await touch('touchEnd', []);
    else await page.mouse.up();
    await settle(page);
  };
  const hold = async (page: Page, key: string, time_ms: number): Promise<void> => {
    await page.locator('#view').focus();
    await page.keyboard.down(key);
    await page.waitForTimeout(time_ms);
    await page.keyboard.up(key);
    await settle(page);
  };
  const expect_inside = ({ position: [x, y, z] }: Pose): void => {
    expect(Math.abs(x)).toBeLessThan(4);
    expect(Math.abs(y + 1.3)).toBeLessThan(1.3);
    expect(Math.abs(z)).toBeLessThan(3);
  };

  it.each([
    ['estimated', 'desktop'],
    ['estimated', 'phone'],
    ['at eye height', 'desktop'],
    ['at eye height', 'phone'],
  ] as const)('turns on the spot: %s, %s', async (start, window) => {
    const { page, errors } = await open(servers[start]!.url, windows[window]);
    const begin = await pose_of(page);
    expect(await mode(page)).not.toBe('Orbit');
    await drag(page, windows[window], [120, 0]);
    const dragged = await pose_of(page);
    await hold(page, 'ArrowLeft', 1000);
    const turned = await pose_of(page);
    for (const pose of [dragged, turned]) expect(distance(begin, pose)).toBeLessThan(0.01);
    expect(dragged.orientation).not.toEqual(begin.orientation);
    expect(turned.orientation).not.toEqual(dragged.orientation);
    expect(errors).toEqual([]);
  });

  it('walks as soon as the floor is known, and stays inside', async () => {
    const { page } = await open(servers['at eye height']!.url, windows.desktop);
    const begin = await pose_of(page);
    await expect.poll(() => mode(page)).toBe('Walk');
    expect(distance(begin, await pose_of(page))).toBeLessThan(0.01);
    await hold(page, 'KeyW', 4000);
    const walked = await pose_of(page);
    expect(distance(begin, walked)).toBeGreaterThan(1);
    expect_inside(walked);
    expect(Math.abs(height(walked) - eye_m)).toBeLessThan(0.3);
    await keep_screenshot(page, 'walk-inside');
  });

  it('stays inside when it orbits', async () => {
    const { page } = await open(servers['estimated']!.url, windows.desktop);
    await page.locator('#view').focus();
    for (let k = 0; k < 3 && (await mode(page)) !== 'Orbit'; ++k) await page.keyboard.press('KeyM');
    expect(await mode(page)).toBe('Orbit');
    const begin = await pose_of(page);
    let farthest = 0; // where a drag or a key ends depends on when the server says what is ahead
    const look = async (): Promise<void> => {
      const pose = await pose_of(page);
      expect_inside(pose);
      farthest = Math.max(farthest, distance(begin, pose));
    };
    for (const by of [
      [300, 0],
      [-500, 40],
      [200, -150],
    ] as const) {
      await drag(page, windows.desktop, by);
      await look();
    }
    for (const key of ['ArrowLeft', 'KeyS', 'KeyD', 'KeyE']) {
      await hold(page, key, 2000);
      await look();
    }
    expect(farthest).toBeGreaterThan(0.5);
    await keep_screenshot(page, 'orbit-inside');
  });
});

describe('an author of a scene without a scale', () => {
  it('is asked about a door while its frame is seen, and the plan knows the answer at once', async () => {
    const room = path.join(scratch_folder(), 'room.ply');
    write_room(room);
    const { url } = await start_server(room, ['--min-fps', '0', '--up', '-y']);
    const { page, errors } = await open(`${url}?author`, {
      viewport: { width: 1440, height: 900 },
    });
    const [question, frame] = [page.locator('#author-door'), page.locator('#door-frame.shown')];
    const look = (up_deg: number): Promise<void> => {
      const half = (up_deg * Math.PI) / 360;
      const at = [0, -eye_m, -2, Math.sin(half), 0, 0, Math.cos(half), 60].join(',');
      return page.evaluate((hash) => void (location.hash = hash), `at=${at}`);
    };
    await page.locator('#button-plan').click();
    const plan = page.locator('#plan-panel');
    await plan.getByText('units of the scene').waitFor();
    for (const up_deg of [0, 80, 0]) {
      await look(up_deg);
      for (const part of [question, frame])
        await part.waitFor({ state: up_deg === 0 ? 'visible' : 'hidden' });
      await keep_screenshot(page, `door-question-${up_deg}`);
    }
    await page.locator('#author-door-fits').click();
    await question.waitFor({ state: 'hidden' });
    await plan.getByText(/^about [\d.,]+\s(ft²|mi²) · [^·]*$/).waitFor();
    await keep_screenshot(page, 'door-answered');
    expect(errors).toEqual([]);
  });
});

describe('the floor plan', () => {
  it('leads to the stops of the tour, by mouse and by keys', async () => {
    const { page, errors } = await open(server.url, windows.desktop);
    const begin = await walk(page);
    await page.getByRole('button', { name: 'Floor plan' }).click();
    const plan = page.locator('#plan-panel');
    await plan.getByRole('button', { name: 'Larger' }).click();
    await plan.locator('[aria-busy=false]').waitFor();
    await plan.getByRole('button', { name: 'Up the street' }).waitFor();
    await settle(page);
    await keep_screenshot(page, 'plan-large');
    expect(await barriers(page)).toEqual([]);
    await plan.getByRole('button', { name: 'Up the street' }).press('Enter');
    await expect.poll(async () => (await pose_of(page)).position[2]).toBeCloseTo(4, 1);
    await page.locator('#tour-title', { hasText: 'Up the street' }).waitFor();
    await plan.getByRole('button', { name: 'Smaller' }).click();
    // A place beside the middle, where the visitor is.
    const picture = (await plan.locator('canvas').boundingBox())!;
    const at_stop = await pose_of(page);
    await page.mouse.click(picture.x + picture.width / 2, picture.y + picture.height / 2 - 24);
    await expect.poll(async () => distance(at_stop, await pose_of(page))).toBeGreaterThan(1);
    expect(distance(begin, at_stop)).toBeGreaterThan(1);
    expect(errors).toEqual([]);
  });

  it('and the editor never cover each other, however large they grow', async () => {
    const { page } = await open(`${server.url}?author`, { viewport: { width: 1440, height: 900 } });
    const [plan, editor] = [page.locator('#plan-panel'), page.locator('#author-panel')];
    await editor.waitFor();
    await page.locator('#button-plan').click();
    await plan.getByRole('button', { name: 'Larger' }).click();
    await plan.locator('[aria-busy=false]').waitFor();
    const [a, b] = [(await plan.boundingBox())!, (await editor.boundingBox())!];
    expect(a.x).toBeGreaterThanOrEqual(0);
    expect(a.x + a.width).toBeLessThanOrEqual(b.x);
    await keep_screenshot(page, 'plan-and-editor');
    await page.setViewportSize({ width: 1000, height: 900 });
    await editor.waitFor({ state: 'hidden' });
    expect(await plan.isVisible()).toBe(true);
    // A panel that grows over another one takes its place.
    await plan.getByRole('button', { name: 'Smaller' }).click();
    await page.locator('#button-measure').click();
    expect(await plan.isVisible()).toBe(true);
    await plan.getByRole('button', { name: 'Larger' }).click();
    await page.locator('#measure-panel').waitFor({ state: 'hidden' });
    expect(await plan.isVisible()).toBe(true);
  });

  it('says its scale, its area, and that it is a sketch, also on paper', async () => {
    const { page } = await open(server.url, windows.desktop);
    const plan = page.locator('#plan-panel');
    const first_words = plan.evaluate(
      (panel) =>
        new Promise<string>((done) => {
          const seen = (): void => done(panel.textContent);
          new MutationObserver(seen).observe(panel, { childList: true });
        }),
    );
    await page.locator('#button-plan').click();
    expect(await first_words).toBe('Drawing the plan…');
    await plan.getByRole('button', { name: 'Larger' }).click();
    await plan
      .getByText(/^about [\d.,]+\s(ft²|mi²) · Sketch from the scan, not a survey$/)
      .waitFor();
    const download = page.waitForEvent('download');
    await plan.getByRole('button', { name: 'Save for printing' }).click();
    const file = await download;
    expect(file.suggestedFilename()).toBe('city-1.png');
    const png = await readFile(await file.path());
    const sides_px = [png.readUInt32BE(16), png.readUInt32BE(20)].sort((a, b) => a - b);
    expect(sides_px).toEqual([2591, 3353]); // Letter, 12 px a mm
    expect(png.subarray(37, 41).toString()).toBe('pHYs');
    expect(png.readUInt32BE(41)).toBe(12_000);
  });

  it('turns with the view, and remembers it', async () => {
    const { page } = await open(server.url, windows.desktop);
    await page.locator('#button-plan').click();
    const turn = page.getByRole('button', { name: 'Turn with the view' });
    await turn.click();
    await page.reload();
    await settle(page);
    await page.locator('#button-plan').click();
    expect(await turn.getAttribute('aria-pressed')).toBe('true');
  });

  it.each([
    ['en', windows.desktop],
    ['de', windows.phone],
    ['ar', windows.phone],
    ['ar', windows.desktop],
  ] as const)('fits in %s', async (language, window) => {
    const { page } = await open(`${server.url}?lang=${language}`, window);
    await page.locator('#button-plan').click();
    await page.locator('#plan-panel [aria-busy=false]').waitFor();
    await settle(page);
    const { width, height: view_height } = window.viewport;
    await keep_screenshot(page, `plan-${language}-${width}`);
    const box = (await page.locator('#plan-panel').boundingBox())!;
    expect(box.x).toBeGreaterThanOrEqual(0);
    expect(box.x + box.width).toBeLessThanOrEqual(width);
    // The middle of the picture stays free.
    const covers =
      box.x < width / 2 &&
      box.x + box.width > width / 2 &&
      box.y < view_height / 2 &&
      box.y + box.height > view_height / 2;
    expect(covers).toBe(false);
    const bar = (await page.locator('#toolbar').boundingBox())!;
    expect(bar.x).toBeGreaterThanOrEqual(0);
    expect(bar.x + bar.width).toBeLessThanOrEqual(width);
    expect(await barriers(page)).toEqual([]);
  });
});
