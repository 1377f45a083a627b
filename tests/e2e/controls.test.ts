// Each control by each input device, against a server that follows a script.
import type { CDPSession, Locator, Page } from 'playwright-core';
import { afterEach, beforeAll, describe, expect, it } from 'vitest';
import { rotate, sub, conjugate, type Vec3 } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { barriers } from './support/axe';
import { keep_screenshot, open as open_page, windows, type WatchedPage } from './support/browser';
import { pose_of, settle } from './support/camera';
import { start_fake_server, type FakeServer } from './support/fake_server';
import { plug_in_gamepad } from './support/gamepad';
import { painted_jpeg, stream_of } from './support/painted';

let server: FakeServer;
let watched: WatchedPage;
let wall_z: number | undefined; // where rays meet the scene

beforeAll(async () => {
  const stream = stream_of(await painted_jpeg());
  server = await start_fake_server((peer, body) => {
    stream(peer, body);
    if (body.case !== 'pick' || wall_z === undefined) return;
    const { id, origin, direction } = body.value;
    peer.say({
      case: 'picked',
      value: { id, hit: true, distance: (wall_z - origin!.z) / direction!.z },
    });
  });
});

afterEach(() => expect(watched.errors).toEqual([]));

async function open(touch = false): Promise<Page> {
  const viewport = { width: 640, height: 360 };
  watched = await open_page(server.url, { viewport, hasTouch: touch, isMobile: touch });
  return watched.page;
}

const turned_by_80_px = Math.sin((Math.PI * 80) / 360); // in a view of 360 px: its height is half a turn

/** A hand that rests before it lets go starts no glide. */
const rest = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 300));

interface Change {
  /** In the camera axes before the movement: x right, y down, z forward. */
  readonly moved: Vec3;
  /** The new view axis, in the same axes. */
  readonly axis: Vec3;
}

async function change_by(page: Page, action: () => Promise<void>): Promise<Change> {
  const before = await pose_of(page);
  await action();
  // A busy page hears of fingers late.
  await expect.poll(() => pose_of(page)).not.toEqual(before);
  await settle(page);
  const after: Pose = await pose_of(page);
  const into = conjugate(before.orientation);
  return {
    moved: rotate(into, sub(after.position, before.position)),
    axis: rotate(into, rotate(after.orientation, [0, 0, 1])),
  };
}

type Axis = 'right' | 'left' | 'down' | 'up' | 'forward' | 'back';
const along: Readonly<Record<Axis, readonly [index: number, sign: number]>> = {
  right: [0, 1],
  left: [0, -1],
  down: [1, 1],
  up: [1, -1],
  forward: [2, 1],
  back: [2, -1],
};

function expect_most(v: Vec3, axis: Axis): void {
  const [index, sign] = along[axis];
  expect(v[index]! * sign).toBeGreaterThan(1e-4);
  expect(Math.abs(v[index]!)).toBe(Math.max(...v.map(Math.abs)));
}

describe('keys', () => {
  it('move and turn the camera, each its way', async () => {
    const page = await open();
    await page.keyboard.press('KeyM'); // fly
    const moves = {
      KeyW: 'forward',
      KeyS: 'back',
      KeyA: 'left',
      KeyD: 'right',
      KeyE: 'up',
      KeyQ: 'down',
    } as const;
    for (const [key, axis] of Object.entries(moves)) {
      expect_most((await change_by(page, () => page.keyboard.press(key))).moved, axis);
    }
    const turns = {
      ArrowLeft: 'left',
      ArrowRight: 'right',
      ArrowUp: 'up',
      ArrowDown: 'down',
    } as const;
    for (const [key, axis] of Object.entries(turns)) {
      const {
        axis: [x, y],
        moved,
      } = await change_by(page, () => page.keyboard.press(key));
      expect_most([x, y, 0], axis);
      expect(Math.hypot(...moved)).toBeLessThan(1e-6);
    }
  });

  it('press every button of the page', async () => {
    const page = await open();
    const panel = async (key: string, id: string): Promise<void> => {
      await page.keyboard.press(key);
      expect(await page.locator(id).isVisible()).toBe(true);
      await page.keyboard.press('Escape');
      expect(await page.locator(id).isHidden()).toBe(true);
    };
    await panel('KeyI', '#stats-panel');
    await panel('KeyH', '#help-panel');
    for (const mode of ['Fly', 'Walk', 'Orbit']) {
      await page.keyboard.press('KeyM');
      await page.locator('#mode-label', { hasText: mode }).waitFor();
    }
    const start = await pose_of(page);
    const { axis } = await change_by(page, () => page.keyboard.press('KeyU'));
    expect(axis[2]).toBeGreaterThan(0.8); // upside down, and looking about the same way
    expect(await pose_of(page)).not.toEqual(start);
    await page.keyboard.press('KeyU');
    await page.keyboard.press('ArrowLeft');
    await settle(page);
    await page.keyboard.press('KeyR');
    await settle(page);
    (await pose_of(page)).position.forEach((v, i) => expect(v).toBeCloseTo(start.position[i]!, 5));
    await page.keyboard.press('KeyF');
    await page.waitForFunction(() => document.fullscreenElement !== null);
    await page.keyboard.press('KeyF');
    await page.waitForFunction(() => document.fullscreenElement === null);
  });

  it('turn a scene over that may be upside down, by the offer or by U', async () => {
    const jpeg = await painted_jpeg();
    const doubtful = await start_fake_server(stream_of(jpeg, { upIsDoubtful: true }));
    watched = await open_page(doubtful.url, { viewport: { width: 640, height: 360 } });
    const { page } = watched;
    const start = await pose_of(page);
    const offer = page.getByRole('button', { name: 'Turn upside down' });
    await change_by(page, () => offer.click());
    const turned = await pose_of(page);
    expect(await page.locator('#notice').isHidden()).toBe(true);
    await page.keyboard.press('KeyU');
    await settle(page);
    (await pose_of(page)).position.forEach((v, i) => expect(v).toBeCloseTo(start.position[i]!, 3));
    await page.keyboard.press('KeyU');
    await settle(page);
    (await pose_of(page)).position.forEach((v, i) => expect(v).toBeCloseTo(turned.position[i]!, 3));
  });

  it('reach every control by Tab, and each says what it is', async () => {
    const page = await open();
    const names = new Set<string>();
    for (let i = 0; i < 24; ++i) {
      await page.keyboard.press('Tab');
      names.add(
        await page.evaluate(() => {
          const { activeElement: at } = document;
          return at?.getAttribute('aria-label') ?? at?.textContent.trim() ?? '';
        }),
      );
    }
    for (const name of [
      'Orbit',
      'Back to the start',
      'Quality and view',
      'Statistics',
      'Share',
      'Controls',
    ]) {
      expect(names).toContain(name);
    }
  });
});

describe('the mouse', () => {
  it('looks, pans, zooms and presses buttons', async () => {
    const page = await open();
    const drag = (button: 'left' | 'right' | 'middle') => async (): Promise<void> => {
      await page.mouse.move(320, 180);
      await page.mouse.down({ button });
      await page.mouse.move(400, 180, { steps: 5 });
      await rest();
      await page.mouse.up({ button });
    };
    const orbited = await change_by(page, drag('left'));
    expect(orbited.axis[0]).toBeCloseTo(turned_by_80_px, 2);
    for (const button of ['right', 'middle'] as const) {
      expect_most((await change_by(page, drag(button))).moved, 'left'); // the scene follows the hand
    }
    expect_most((await change_by(page, () => page.mouse.wheel(0, -200))).moved, 'forward');
    expect_most((await change_by(page, () => page.mouse.wheel(0, 200))).moved, 'back');
    for (const [button, id] of [
      ['Quality and view', '#quality-panel'],
      ['Statistics', '#stats-panel'],
      ['Share', '#share-panel'],
    ] as const) {
      await page.locator('#toolbar').getByRole('button', { name: button }).click();
      expect(await page.locator(id).isVisible()).toBe(true);
      await page.keyboard.press('Escape');
    }
    await page.getByRole('button', { name: 'Orbit' }).click();
    await page.locator('#mode-label', { hasText: 'Fly' }).waitFor();
    await page.getByRole('button', { name: 'Back to the start' }).click();
    await page.getByRole('button', { name: 'Full screen' }).click();
    await page.waitForFunction(() => document.fullscreenElement !== null);
  });
});

describe('the field of view', () => {
  it('is chosen by keys, follows stops and links, and goes back to that of the scene', async () => {
    const stop = (title: string, z: number, more: object) => ({
      title,
      position: [0, 0, z],
      look_at: [0, 0, 0],
      fly_s: 0.1,
      ...more,
    });
    const stops = [
      stop('Detail', -3, { fov_deg: 35 }),
      stop('Hall', -4, {}),
      stop('Garden', -9, { fly_s: 60 }),
    ];
    const { url, peers } = await start_fake_server(stream_of(await painted_jpeg()), {
      tours: [{ title: 'Lenses', stops }],
    });
    watched = await open_page(url, windows.desktop);
    let { page } = watched;
    const slider = (): Locator => page.getByRole('slider', { name: 'Field of view' });
    const asked_deg = (): number => {
      const asked = peers
        .at(-1)!
        .heard.flatMap((body) => (body.case === 'pose' ? [body.value] : []));
      return (asked.at(-1)!.fovYRad * 180) / Math.PI;
    };
    const expect_deg = async (deg: number): Promise<void> => {
      await expect.poll(() => slider().getAttribute('aria-valuetext')).toBe(`${deg}°`);
      await expect.poll(asked_deg).toBeCloseTo(deg, 1);
      expect(await slider().inputValue()).toBe(String(deg));
    };
    await page.getByRole('button', { name: 'Quality and view' }).click();
    await slider().press('ArrowRight');
    await expect_deg(61);
    await slider().press('End');
    await expect_deg(110);
    expect(await barriers(page)).toEqual([]);
    await keep_screenshot(page, 'field-of-view');
    const to_next_stop = (): Promise<void> =>
      page.getByRole('button', { name: 'Next stop' }).click();
    await to_next_stop();
    await expect_deg(35);
    await slider().press('ArrowRight');
    await expect_deg(36);
    await page.getByRole('button', { name: 'Share' }).click();
    const address = await page.locator('#share-link').inputValue();
    await page.getByRole('button', { name: 'Quality and view' }).click();
    await to_next_stop();
    await expect_deg(60);
    await to_next_stop();
    await slider().press('End');
    await expect_deg(110); // the flight has ended
    expect(watched.errors).toEqual([]);
    watched = await open_page(address, windows.desktop);
    ({ page } = watched);
    await page.getByRole('button', { name: 'Quality and view' }).click();
    await expect_deg(36);
    await to_next_stop();
    await expect_deg(60); // the stop has none of its own
    await slider().press('Home');
    await expect_deg(20);
    await page.getByRole('button', { name: "The scene's own field of view" }).press('Enter');
    await expect_deg(60);
  });
});

describe('which way is up', () => {
  it('is set by quarter turns, and by the surface in the middle of the view', async () => {
    const page = await open();
    await page.getByRole('button', { name: 'Quality and view' }).click();
    const up_now = async (): Promise<Vec3> => rotate((await pose_of(page)).orientation, [0, -1, 0]);
    await page.getByRole('button', { name: 'Turn left' }).click(); // the picture's top goes to the left, as the camera's goes to the right
    await expect
      .poll(up_now)
      .toEqual([expect.closeTo(1, 6), expect.closeTo(0, 6), expect.closeTo(0, 6)]);
    await page.getByRole('button', { name: 'Turn right' }).click();
    await expect
      .poll(up_now)
      .toEqual([expect.closeTo(0, 6), expect.closeTo(-1, 6), expect.closeTo(0, 6)]);

    await page.getByRole('button', { name: 'Use the surface in the middle as the floor' }).click();
    await page.getByText('There is no surface in the middle').waitFor();
    wall_z = 0;
    await page.getByRole('button', { name: 'Use the surface in the middle as the floor' }).click();
    // The wall has become the floor, seen from 30 degrees above it.
    await expect.poll(async () => (await pose_of(page)).position[2]).toBeCloseTo(-2.5, 3);
    expect((await up_now())[2]).toBeCloseTo(-Math.cos(Math.PI / 6), 3);
  });
});

describe('speed', () => {
  it('is chosen by wheel, keys and slider, and kept', async () => {
    const page = await open();
    const speed = page.locator('#view-speed-value');
    await page.keyboard.press('KeyM'); // fly
    await page.mouse.move(320, 180);
    for (let i = 0; i < 4; ++i) await page.mouse.wheel(0, -100);
    await page.locator('#notice', { hasText: 'Speed 2×' }).waitFor();
    await page.keyboard.press('-');
    await page.locator('#notice', { hasText: 'Speed 1.4×' }).waitFor();
    await page.getByRole('button', { name: 'Quality and view' }).click();
    await page.getByLabel('Speed', { exact: false }).fill('-2');
    await expect.poll(() => speed.textContent()).toBe('0.25×');
    await page.reload();
    await expect.poll(() => speed.textContent()).toBe('0.25×');
  });
});

describe('fingers', () => {
  const swipe = async (
    touch: CDPSession,
    at: (t: number) => { x: number; y: number }[],
  ): Promise<void> => {
    await touch.send('Input.dispatchTouchEvent', { type: 'touchStart', touchPoints: at(0) });
    for (const t of [0.25, 0.5, 0.75, 1]) {
      await touch.send('Input.dispatchTouchEvent', { type: 'touchMove', touchPoints: at(t) });
    }
    await rest();
    await touch.send('Input.dispatchTouchEvent', { type: 'touchEnd', touchPoints: [] });
  };

  it('look with one, pan and pinch with two, and tap buttons', async () => {
    const page = await open(true);
    const touch = await page.context().newCDPSession(page);
    const one = await change_by(page, () => swipe(touch, (t) => [{ x: 200 + 80 * t, y: 150 }]));
    expect(one.axis[0]).toBeCloseTo(turned_by_80_px, 2);
    const pair = (x: number, apart: number): { x: number; y: number }[] => [
      { x: x - apart, y: 150 },
      { x: x + apart, y: 150 },
    ];
    expect_most(
      (await change_by(page, () => swipe(touch, (t) => pair(250 + 80 * t, 50)))).moved,
      'left',
    );
    expect_most(
      (await change_by(page, () => swipe(touch, (t) => pair(300, 40 + 60 * t)))).moved,
      'forward',
    );
    expect_most(
      (await change_by(page, () => swipe(touch, (t) => pair(300, 100 - 60 * t)))).moved,
      'back',
    );
    await page.getByRole('button', { name: 'Quality and view' }).tap();
    expect(await page.locator('#quality-panel').isVisible()).toBe(true);
    await page.getByRole('slider', { name: 'Field of view' }).fill('90');
    await page.locator('#view-fov-value', { hasText: '90°' }).waitFor();
  });

  const tap = (page: Page): Promise<void> => page.touchscreen.tap(200, 220);

  it('look at a point by a double tap', async () => {
    const page = await open(true);
    await tap(page);
    await tap(page);
    await expect
      .poll(() => server.peers.at(-1)!.heard.some((body) => body.case === 'pick'))
      .toBe(true);
  });

  it('walk to a point by one tap', async () => {
    wall_z = 0;
    const page = await open(true);
    for (const mode of ['Orbit', 'Fly']) await page.getByRole('button', { name: mode }).tap();
    const { moved } = await change_by(page, () => tap(page));
    expect_most(moved, 'forward');
    expect(moved[1]).toBeCloseTo(0, 6);
  });
});

describe('a gamepad', () => {
  it('moves by its sticks and triggers, looks, and presses its buttons', async () => {
    const page = await open();
    const set = await plug_in_gamepad(page);
    await page.keyboard.press('KeyM'); // fly
    const push =
      (axes: number[], button = -1) =>
      async (): Promise<void> => {
        const before = await pose_of(page);
        await set(axes, button);
        await expect.poll(() => pose_of(page)).not.toEqual(before);
        await set([0, 0, 0, 0]);
      };
    expect_most((await change_by(page, push([0, -1, 0, 0]))).moved, 'forward');
    expect_most((await change_by(page, push([1, 0, 0, 0]))).moved, 'right');
    const {
      axis: [x, y],
    } = await change_by(page, push([0, 0, 1, 0]));
    expect_most([x, y, 0], 'right');
    expect_most((await change_by(page, push([0, 0, 0, 0], 7))).moved, 'up');
    expect_most((await change_by(page, push([0, 0, 0, 0], 6))).moved, 'down');
  });
});
