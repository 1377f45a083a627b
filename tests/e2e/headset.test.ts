// A visit in a headset: what the server hears, and what both eyes see. The server follows a script.
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { add, axis_angle, forward, multiply, rotate, type Vec3 } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import type { FrustumView } from '#client/present/frustum';
import { Codec } from '#client/wire/wire';
import { barriers } from './support/axe';
import { in_page, keep_screenshot, new_page, open } from './support/browser';
import { pose_of, settle } from './support/camera';
import {
  start_fake_server,
  welcome,
  type FakeServer,
  type Peer,
  type ServerBody,
  type Script,
} from './support/fake_server';
import {
  between_eyes_m,
  enter,
  pointing,
  press,
  push_stick,
  put,
  refreshes,
  standing,
  with_headset,
} from './support/headset';
import { artefacts } from './support/paths';
import { painted_jpeg, stream_of } from './support/painted';
import { psnr_db, read_png, type Picture } from './support/pictures';
import { block_shifts, median } from './support/registration';
import { street_view, street_view_depths } from './support/street';

const window_size = { viewport: { width: 1280, height: 640 } }; // 640x640 for each eye
const start: Vec3 = [0, 0, -1];
const frustum = { left: -1.4, right: 1.4, up: -1.3, down: 1.3 };
const eye_of = (head: Pose, side: -1 | 1): Pose => ({
  ...head,
  position: add(head.position, rotate(head.orientation, [(side * between_eyes_m) / 2, 0, 0])),
});
const degree_px = (Math.PI / 180) * 320; // in the middle of a view of 90 degrees

const at_start: Pose = { position: start, orientation: [0, 0, 0, 1] };
const drawn: readonly FrustumView[] = ([-1, 1] as const).map((side) => ({
  ...eye_of(at_start, side),
  frustum,
}));
const [width, height] = [1792, 832];
let jpeg: Uint8Array;

beforeAll(async () => {
  const { rgba } = street_view(drawn, width, height);
  const url = await in_page((page) =>
    page.evaluate(
      ([pixels, columns, rows]) => {
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [columns, rows];
        const bytes = Uint8Array.from(atob(pixels), (c) => c.charCodeAt(0));
        const image = new ImageData(new Uint8ClampedArray(bytes), columns, rows);
        canvas.getContext('2d')!.putImageData(image, 0, 0);
        return canvas.toDataURL('image/jpeg', 0.95);
      },
      [Buffer.from(rgba).toString('base64'), width, height] as const,
    ),
  );
  jpeg = Buffer.from(url.split(',')[1]!, 'base64');
});

const scene = {
  scale: 7, // a metre is 1
  startPose: { position: { x: start[0], y: start[1], z: start[2] }, orientation: { w: 1 } },
};

const settings_of = (peer: Peer) =>
  peer.heard.flatMap(({ case: kind, value }) =>
    kind === 'hello' && value.settings ? [value.settings] : kind === 'settings' ? [value] : [],
  );
const poses_of = (peer: Peer) =>
  peer.heard.flatMap(({ case: kind, value }) => (kind === 'pose' ? [value] : []));

const header_of = (peer: Peer, poseId: bigint, poseClientTimeUs: bigint) => ({
  frameId: BigInt(peer.heard.length),
  poseId,
  poseClientTimeUs,
  renderPose: { position: scene.startPose.position, orientation: { w: 1 } },
  fovYRad: 1,
  codec: Codec.MJPEG,
  idr: true,
  widthPx: width,
  heightPx: height,
});

function show_both_eyes(peer: Peer, poseId: bigint, poseClientTimeUs: bigint): void {
  const eye = (side: number) => ({ rightOfPose: (side * between_eyes_m) / 2, ...frustum });
  peer.frame(
    {
      ...header_of(peer, poseId, poseClientTimeUs),
      stereo: { left: eye(-1), right: eye(1) },
      ...street_view_depths(drawn, 128, 36),
    },
    jpeg,
  );
}

/** Shows the street to both eyes from where the visit began, whatever the head does: pictures that never come. */
const late: Script = (peer, body) => {
  if (body.case === 'hello') peer.say(welcome(scene));
  if (body.case !== 'pose') return;
  if (settings_of(peer).at(-1)?.stereo)
    show_both_eyes(peer, body.value.poseId, body.value.clientTimeUs);
  else peer.frame(header_of(peer, body.value.poseId, body.value.clientTimeUs), jpeg);
};

/** What both eyes see, side by side. */
async function seen(page: Page, name: string): Promise<Picture> {
  await refreshes(page, 40); // it brightens
  await keep_screenshot(page, name);
  return read_png(page, path.join(artefacts, `${name}.png`));
}

/** A part of the view of an eye; the panel is in its lower half. */
function upper_part({ width: wide, rgba }: Picture, half: 0 | 1): Picture {
  const [columns, rows, left, top] = [440, 260, half * (wide / 2) + 100, 60];
  const part = new Uint8ClampedArray(4 * columns * rows);
  for (let row = 0; row < rows; ++row) {
    const begin = 4 * ((top + row) * wide + left);
    part.set(rgba.subarray(begin, begin + 4 * columns), 4 * columns * row);
  }
  return { width: columns, height: rows, rgba: part };
}

/** How far things are from where each eye should see them, in increasing order, degrees. */
function errors_deg(shown: Picture, head: Pose): number[] {
  const view = { left: -1, right: 1, up: -1, down: 1 };
  const truth = street_view(
    ([-1, 1] as const).map((side) => ({ ...eye_of(head, side), frustum: view })),
    1280,
    640,
  );
  return ([0, 1] as const)
    .flatMap((half) => block_shifts(upper_part(shown, half), upper_part(truth, half), 16))
    .map(({ dx, dy }) => Math.hypot(dx, dy) / degree_px)
    .sort((a, b) => a - b);
}

const p95 = (sorted: readonly number[]): number => sorted[Math.floor(0.95 * sorted.length)]!;

async function visit(
  script: Script = late,
): Promise<{ page: Page; server: FakeServer; errors: string[] }> {
  const server = await start_fake_server(script);
  const { page, errors } = await open(server.url, window_size, with_headset);
  await enter(page);
  return { page, server, errors };
}

describe('a page', () => {
  it('offers no headset where there is none, and loads nothing of it', async () => {
    const server = await start_fake_server(stream_of(await painted_jpeg()));
    const { page } = await new_page(window_size);
    const loaded: string[] = [];
    page.on('request', (request) => loaded.push(request.url()));
    await page.goto(server.url);
    await settle(page);
    const is_there = await page.evaluate(async () => {
      const { xr } = navigator as unknown as {
        xr?: { isSessionSupported(mode: string): Promise<boolean> };
      };
      return (await xr?.isSessionSupported('immersive-vr')) ?? false;
    });
    expect(is_there).toBe(false);
    expect(await page.locator('#button-headset').isVisible()).toBe(false);
    expect(loaded.filter((url) => url.includes('headset'))).toEqual([]);
  });

  it('offers a headset where there is one, to all visitors', async () => {
    const server = await start_fake_server(stream_of(await painted_jpeg()));
    const { page, errors } = await open(server.url, window_size, with_headset);
    await page.getByRole('button', { name: 'Enter VR' }).waitFor();
    await keep_screenshot(page, 'headset-offered');
    expect(await barriers(page)).toEqual([]);
    expect(errors).toEqual([]);
  });

  it('says so when the headset does not start', async () => {
    const server = await start_fake_server(stream_of(await painted_jpeg()));
    const { page } = await open(server.url, window_size, with_headset);
    await page.evaluate(() => {
      const { xr } = navigator as unknown as { xr: { requestSession: () => Promise<never> } };
      xr.requestSession = () => Promise.reject(new Error('somebody else wears it'));
    });
    await page.getByRole('button', { name: 'Enter VR' }).click();
    await page.getByText('The headset did not start.').waitFor();
  });
});

describe('a page that watches somebody with a headset', () => {
  it('shows what their left eye sees', async () => {
    const server = await start_fake_server((peer, body) => {
      if (body.case !== 'hello') return;
      const { value, ...said } = welcome(scene);
      peer.say({ ...said, value: { ...value, watching: true } } as ServerBody);
      show_both_eyes(peer, 1n, 0n);
    });
    const { page, errors } = await new_page(window_size);
    await page.goto(server.url);
    await page.locator('#card').waitFor({ state: 'hidden' });
    const shot = await page.evaluate(() => window.catgs!.snapshot());
    expect([shot.width_px, shot.height_px]).toEqual([width / 2, height]);
    const left = street_view(drawn.slice(0, 1), width / 2, height);
    const shown = { width: shot.width_px, height: shot.height_px, rgba: shot.rgba };
    expect(psnr_db(shown, left)).toBeGreaterThan(30);
    expect(errors).toEqual([]);
  });
});

describe('a visitor with a headset', () => {
  it('asks for pictures of both eyes, and sends the poses of the head', async () => {
    const { page, server, errors } = await visit();
    const [peer] = server.peers;
    const { stereo, ...settings } = settings_of(peer!).at(-1)!;
    expect(stereo?.left?.rightOfPose).toBeCloseTo(-between_eyes_m / 2, 4);
    expect(stereo?.right?.rightOfPose).toBeCloseTo(between_eyes_m / 2, 4);
    // 90 degrees, and overscan.
    expect(stereo?.left?.right).toBeCloseTo(1.26, 3);
    expect(stereo?.left?.up).toBeCloseTo(-1.12, 3);
    expect(settings.widthPx / settings.heightPx).toBeCloseTo((2 * 1.26) / 1.12, 2);
    expect(settings.depths).toBe(true);
    expect(settings.maxFps).toBe(72);
    // The head is where the visitor stood in the page.
    const { position, orientation } = poses_of(peer!).at(-1)!.worldFromCamera!;
    expect(position).toMatchObject({ x: 0, z: -1 });
    expect(position!.y).toBeCloseTo(0, 4);
    expect(orientation!.w).toBeCloseTo(1, 5);
    // A turn to the right and a step to the left.
    const asked = settings_of(peer!).length;
    const turn = axis_angle([0, 1, 0], 0.3);
    await put(page, 'head', { position: [-0.2, -1.6, 0.1], orientation: turn });
    const moved = poses_of(peer!).at(-1)!.worldFromCamera!;
    expect(moved.position!.x).toBeCloseTo(-0.2, 4);
    expect(moved.position!.z).toBeCloseTo(-0.9, 4);
    expect(moved.orientation!.y).toBeCloseTo(Math.sin(0.15), 4);
    await expect
      .poll(() => page.evaluate(async () => (await window.catgs!.stats()).headset_hz))
      .toBeGreaterThan(1);
    // Rounding differs with each pose, and does not ask for another stream.
    expect(settings_of(peer!).length).toBeLessThanOrEqual(asked + 3);
    expect(errors).toEqual([]);
  });

  it.each([
    ['still', 0, [0, 0, 0]],
    ['turned', 0.14, [0, 0, 0]],
    ['moved', -0.05, [0.1, -0.03, 0.12]],
  ] as const)(
    'sees things where they are, with a head that has %s',
    async (name, turn_rad, way) => {
      const { page, errors } = await visit();
      const orientation = multiply(
        axis_angle([0, 1, 0], turn_rad),
        axis_angle([0, 0, 1], turn_rad / 2),
      );
      await put(page, 'head', { position: add(standing.position, way), orientation });
      const shown = await seen(page, `headset-${name}`);
      const errors_of = errors_deg(shown, { position: add(start, way), orientation });
      console.log(
        `${name}: ${median(errors_of).toFixed(2)}, ${p95(errors_of).toFixed(2)} degrees (median, p95) of ${errors_of.length} blocks`,
      );
      expect(errors_of.length).toBeGreaterThan(150);
      expect(median(errors_of)).toBeLessThan(0.2);
      expect(p95(errors_of)).toBeLessThanOrEqual(1);
      expect(errors).toEqual([]);
    },
  );

  it('turns by 30 degrees for each push of a stick', async () => {
    const { page, errors } = await visit();
    await put(page, 'left', { position: [-0.2, -1.2, 0.3], orientation: [0, 0, 0, 1] });
    await put(page, 'right', { position: [0.2, -1.2, 0.3], orientation: [0, 0, 0, 1] });
    await push_stick(page, 'right', 1, 0);
    await push_stick(page, 'right', 0, 0);
    const heading = (pose: Pose): number => {
      const [x, , z] = rotate(pose.orientation, forward);
      return (Math.atan2(x, z) * 180) / Math.PI;
    };
    expect(heading(await pose_of(page))).toBeCloseTo(30, 2);
    for (let i = 0; i < 2; ++i) {
      await push_stick(page, 'right', -1, 0);
      await push_stick(page, 'right', 0, 0);
    }
    expect(heading(await pose_of(page))).toBeCloseTo(-30, 2);
    expect((await pose_of(page)).position[0]).toBeCloseTo(0, 4); // about the visitor
    await seen(page, 'headset-snap-turn');
    expect(errors).toEqual([]);
  });

  it('stays where they are when they centre the headset anew', async () => {
    const { page } = await visit();
    await put(page, 'head', { position: [0.4, -1.6, 0.3], orientation: [0, 0, 0, 1] });
    const before = await pose_of(page);
    await page.evaluate(() => window.emulated!.recenter());
    await put(page, 'head', standing);
    const after = await pose_of(page);
    after.position.forEach((v, i) => expect(v).toBeCloseTo(before.position[i]!, 2));
  });

  it('flies by the other stick, in the dark at the edges', async () => {
    const { page } = await visit();
    await put(page, 'left', { position: [-0.2, -1.2, 0.3], orientation: [0, 0, 0, 1] });
    await put(page, 'right', { position: [0.2, -1.2, 0.3], orientation: [0, 0, 0, 1] });
    const bright = await seen(page, 'headset-before-flight');
    await push_stick(page, 'left', 0, -1);
    await expect.poll(async () => (await pose_of(page)).position[2]).toBeGreaterThan(-0.5);
    const dark = await seen(page, 'headset-flight');
    await push_stick(page, 'left', 0, 0);
    const corner = (picture: Picture): number => picture.rgba[4 * (20 * picture.width + 20)]!;
    expect(corner(dark)).toBeLessThan(corner(bright) / 3);
    const there = await pose_of(page);
    await refreshes(page, 10);
    expect((await pose_of(page)).position[2]).toBeCloseTo(there.position[2], 3);
  });

  it('leaves by the panel, and the page continues where the head was', async () => {
    const { page, server, errors } = await visit();
    const tilted = multiply(axis_angle([0, 1, 0], 0.4), axis_angle([0, 0, 1], 0.3));
    await put(page, 'head', { position: [0.1, -1.5, 0.2], orientation: tilted });
    await seen(page, 'headset-panel');
    const is_worn = (): Promise<boolean> =>
      page.evaluate(() => window.emulated!.activeSession !== undefined);
    // Its lowest row has two buttons, and the right one leaves. The visitor looks for it from below.
    for (let low = 0.7; low > 0.2 && (await is_worn()); low -= 0.04) {
      await put(page, 'right', pointing([0.1, -1.3, 0.1], [0.14, low - 1.6, 0.9]));
      await press(page);
    }
    expect(await is_worn()).toBe(false);
    await settle(page);
    const { position, orientation } = await pose_of(page);
    expect(position[0]).toBeCloseTo(0.1, 3);
    expect(position[2]).toBeCloseTo(-0.8, 3);
    expect(rotate(orientation, forward)[0]).toBeCloseTo(Math.sin(0.4), 3);
    expect(rotate(orientation, [1, 0, 0])[1]).toBeCloseTo(0, 4); // level
    const last = settings_of(server.peers[0]!).at(-1)!;
    expect(last.stereo).toBeUndefined();
    expect((await page.evaluate(() => window.catgs!.stats())).headset_hz).toBeUndefined();
    await keep_screenshot(page, 'headset-left');
    await enter(page); // and comes back
    expect(settings_of(server.peers[0]!).at(-1)!.stereo).toBeDefined();
    expect(errors).toEqual([]);
  });

  it('reads of a lost link before them, and sees the scene move on when it is back', async () => {
    let refuses = false;
    const { page, server } = await visit((peer, body) => {
      if (refuses) peer.close();
      else late(peer, body);
    });
    const before = await seen(page, 'headset-linked');
    refuses = true;
    server.peers[0]!.close();
    await page.locator('#card').waitFor();
    const lost = await seen(page, 'headset-lost');
    // The panel is now where the visitor looks.
    const panel_pixels = ({ width: wide, rgba }: Picture): number => {
      let count = 0;
      for (let y = 270; y < 410; ++y)
        for (let x = 220; x < 445; ++x)
          count += Number(
            [16, 18, 24].every((v, i) => Math.abs(rgba[4 * (y * wide + x) + i]! - v) < 16),
          );
      return count;
    };
    expect(panel_pixels(before)).toBeLessThan(100);
    expect(panel_pixels(lost)).toBeGreaterThan(1000);
    refuses = false;
    await page.locator('#card').waitFor({ state: 'hidden' });
    const newest = server.peers.at(-1)!;
    await expect.poll(() => poses_of(newest).length).toBeGreaterThan(3);
    expect(settings_of(newest).at(-1)!.stereo).toBeDefined();
    await seen(page, 'headset-linked-again');
  });

  it('needs no pictures while they have taken it off', async () => {
    const { page, server } = await visit();
    const pauses = (): boolean[] =>
      server.peers[0]!.heard.flatMap(({ case: kind, value }) =>
        kind === 'pause' ? [value.paused] : [],
      );
    await page.evaluate(() => window.emulated!.updateVisibilityState('hidden'));
    await expect.poll(pauses).toEqual([true]);
    await page.evaluate(() => window.emulated!.updateVisibilityState('visible'));
    await expect.poll(pauses).toEqual([true, false]);
    const acks = (): number =>
      server.peers[0]!.heard.filter(({ case: kind, value }) => kind === 'ack' && !value.dropped)
        .length;
    const so_far = acks();
    await expect.poll(acks).toBeGreaterThan(so_far + 2);
  });
});
