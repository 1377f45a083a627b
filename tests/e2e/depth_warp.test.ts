// Checks in a real browser that a picture whose camera has walked on shows things where they are now.
import { beforeAll, expect, it } from 'vitest';
import type { Eye, Pose } from '#client/camera/eye';
import type { DepthFields } from '#client/present/depth_mesh';
import { Codec } from '#client/wire/wire';
import { in_page, keep_screenshot, open } from './support/browser';
import { settle } from './support/camera';
import { start_fake_server, welcome, type Script } from './support/fake_server';
import type { Picture } from './support/pictures';
import { block_shifts, median } from './support/registration';
import { street_depths, street_picture } from './support/street';

const [width, height] = [640, 360];
const picture_eye: Eye = { position: [0, 0, -1], orientation: [0, 0, 0, 1], fov_y_rad: 1.15 };
/** After 80 ms at 1.4 m/s and at 4 m/s, aside and on. */
const walked: Pose = { position: [0.08, 0, -0.92], orientation: [0, 0.01, 0, 0.99995] };
const flown: Pose = { position: [-0.2, -0.05, -0.75], orientation: [0, -0.01, 0, 0.99995] };

let jpeg: Uint8Array;

beforeAll(async () => {
  const { rgba } = street_picture(picture_eye, width, height);
  const url = await in_page((page) =>
    page.evaluate(
      ([pixels, columns, rows]) => {
        const canvas = document.createElement('canvas');
        [canvas.width, canvas.height] = [columns, rows];
        const image = new ImageData(Uint8ClampedArray.from(pixels), columns, rows);
        canvas.getContext('2d')!.putImageData(image, 0, 0);
        return canvas.toDataURL('image/jpeg', 0.95);
      },
      [[...rgba], width, height] as const,
    ),
  );
  jpeg = Buffer.from(url.split(',')[1]!, 'base64');
});

/** Answers every pose with the same picture, from where the camera was long ago. */
const late =
  (depths?: DepthFields): Script =>
  (peer, body) => {
    if (body.case === 'hello') peer.say(welcome());
    if (body.case !== 'pose') return;
    const asked = peer.heard.some(({ case: kind, value }) => kind === 'settings' && value.depths);
    const [x, y, z] = picture_eye.position;
    peer.frame(
      {
        frameId: BigInt(peer.heard.length),
        poseId: body.value.poseId,
        poseClientTimeUs: body.value.clientTimeUs,
        renderPose: { position: { x, y, z }, orientation: { w: 1 } },
        fovYRad: picture_eye.fov_y_rad,
        codec: Codec.MJPEG,
        idr: true,
        widthPx: width,
        heightPx: height,
        ...(asked && depths),
      },
      jpeg,
    );
  };

/** How far blocks of the canvas are from where they should be, in increasing order, px. */
async function errors_px(name: string, pose: Pose, depths?: DepthFields): Promise<number[]> {
  const server = await start_fake_server(late(depths));
  const viewport = { width, height };
  const { page, errors } = await open(`${server.url}?presenter=webgl2`, { viewport });
  await page.keyboard.press('KeyM'); // fly
  await settle(page);
  await expect
    .poll(() =>
      server.peers[0]!.heard.some(({ case: kind, value }) => kind === 'settings' && value.depths),
    )
    .toBe(true);
  const shot = await page.evaluate(
    async ([to, fov]) => {
      window.catgs!.setPose(to, fov);
      await window.catgs!.settled();
      return window.catgs!.snapshot();
    },
    [pose, 1] as const,
  );
  await keep_screenshot(page, name);
  expect(errors).toEqual([]);
  await page.close();
  const shown: Picture = { width: shot.width_px, height: shot.height_px, rgba: shot.rgba };
  const truth = street_picture(shot.view, shown.width, shown.height);
  const shifts = block_shifts(shown, truth, 16).map(({ dx, dy }) => Math.hypot(dx, dy));
  return shifts.sort((a, b) => a - b);
}

const p95 = (sorted: readonly number[]): number => sorted[Math.floor(0.95 * sorted.length)]!;

it.each([
  ['walks', walked],
  ['flies', flown],
] as const)('things are where they belong while the camera %s', async (name, pose) => {
  const depths = street_depths(picture_eye, width / height, 64, 36);
  const by_depths = await errors_px(`${name}_by_depths`, pose, depths);
  const turned = await errors_px(`${name}_turned_only`, pose);
  const figures = (e: readonly number[]): string =>
    `${median(e).toFixed(2)}, ${p95(e).toFixed(2)} px`;
  console.log(`${name}: ${figures(by_depths)} by depths, ${figures(turned)} without (median, p95)`);
  expect(by_depths.length).toBeGreaterThan(150);
  expect(median(by_depths)).toBeLessThanOrEqual(1);
  expect(p95(by_depths)).toBeLessThanOrEqual(3);
  expect(median(turned)).toBeGreaterThan(1);
});
