// Captions with Markdown, and hostile ones, against a server that follows a script.
import type { BrowserContextOptions } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { angle_between } from '#client/base/vector';
import { barriers } from './support/axe';
import { keep_screenshot, open } from './support/browser';
import { pose_of, settle } from './support/camera';
import { start_fake_server, type FakeServer, type Script } from './support/fake_server';
import { start_other_site } from './support/other_site';
import { painted_jpeg, stream_of } from './support/painted';

const windows: Readonly<Record<string, BrowserContextOptions>> = {
  desktop: { viewport: { width: 1280, height: 720 } },
  phone: { viewport: { width: 390, height: 844 }, hasTouch: true, isMobile: true },
};

let stream: Script;

beforeAll(async () => {
  stream = stream_of(await painted_jpeg());
});

const with_captions = (...captions: string[]): Promise<FakeServer> => {
  const stops = captions.map((caption, i) => ({
    title: `Stop ${i}`,
    caption,
    marker: [i, 0, 5],
    position: [0, 0, -5],
    orientation: [0, 0, 0, 1],
  }));
  return start_fake_server(stream, { tours: [{ title: 'Tour', stops }] });
};

describe('a caption', () => {
  const rich = [
    'Built in **1904** by *Ada Lovelace*,\nof stone from the valley.',
    '- the [archive](https://archive.example/hall) has the plans\n- visits: `9–17 h`',
    '> It stands.',
  ].join('\n\n');

  it.each(Object.keys(windows))('shows its Markdown on a %s', async (name) => {
    const server = await with_captions('Plain words,\non two lines.', rich);
    const { page, errors } = await open(`${server.url}?scene=city`, windows[name]);
    await page.locator('#tour-next').click();
    const text = page.locator('#tour-text');
    await expect.poll(() => text.innerText()).toBe('Plain words,\non two lines.');
    expect(await text.locator('*').count()).toBe(0);
    await page.locator('#tour-next').click();
    const link = page.getByRole('link', { name: 'archive' });
    await link.waitFor();
    expect(await text.locator('strong').innerText()).toBe('1904');
    expect(await link.evaluate((a: HTMLAnchorElement) => [a.href, a.target, a.rel])).toEqual([
      'https://archive.example/hall',
      '_blank',
      'noopener noreferrer',
    ]);
    expect(await text.innerText()).toContain('Ada Lovelace,\nof stone');
    await keep_screenshot(page, `caption-${name}`);
    expect([await barriers(page), errors]).toEqual([[], []]);
  });

  it('is in its hotspot in words alone', async () => {
    const server = await with_captions(rich);
    const { page } = await open(`${server.url}?scene=city`, windows['desktop']);
    const caption = page.locator('.hotspot-caption');
    await expect.poll(() => caption.textContent()).toMatch(/^Built in 1904 by Ada Lovelace/);
    expect(await caption.locator('*').count()).toBe(0);
  });
});

it('a hostile caption runs nothing, asks nobody and leads nowhere', async () => {
  const other = await start_other_site('');
  const spy = `${other.origin}/spy`;
  const server = await with_captions(
    `**x** <script>document.title = 'taken'</script><img src="${spy}" onerror="document.title = 'taken'"><svg onload="document.title = 'taken'">`,
    `![x](${spy}) [x](javascript:document.title='taken') <javascript:document.title='taken'> [x](/api/scenes) [x][y]\n\n[y]: ${spy}`,
    `<style>* { display: none }</style>\n\n**x** <iframe src="${spy}"></iframe><link rel="stylesheet" href="${spy}"><meta http-equiv="refresh" content="0; url=${spy}">`,
    '>'.repeat(4000),
  );
  const { page, errors } = await open(`${server.url}?scene=city`, windows['desktop']);
  const text = page.locator('#tour-text');
  for (let i = 0; i < 4; ++i) {
    await page.locator('#tour-next').click();
    await page.getByRole('heading', { name: `Stop ${i}` }).waitFor();
    await expect.poll(() => text.locator('p, blockquote').count()).toBeGreaterThan(0);
    const kinds = await text.evaluate((element) => [
      ...new Set([...element.querySelectorAll('*')].map(({ tagName }) => tagName)),
    ]);
    expect(kinds.filter((kind) => !['P', 'STRONG', 'BLOCKQUOTE'].includes(kind))).toEqual([]);
  }
  await page.waitForTimeout(300);
  expect(await page.title()).toBe('Demo city – CaT-GS');
  expect(other.asked).toEqual([]);
  expect(errors).toEqual([]);
});

describe('a hotspot', () => {
  it.each(Object.keys(windows))(
    'leaves drags to the view, and opens by a press on a %s',
    async (name) => {
      const server = await with_captions('Here.');
      const { page, errors } = await open(`${server.url}?scene=city`, windows[name]);
      const spot = page.locator('.hotspot');
      await spot.waitFor();
      const { x, y, width, height } = (await spot.boundingBox())!;
      const finger = await page.context().newCDPSession(page);
      /** A press on the hotspot, and a way from there to the right. */
      const drag = async (...way_px: number[]): Promise<void> => {
        const points = way_px.map((right) => ({ x: x + width / 2 + right, y: y + height / 2 }));
        if (name === 'desktop') {
          await page.mouse.move(points[0]!.x, points[0]!.y);
          await page.mouse.down();
          for (const point of points) await page.mouse.move(point.x, point.y);
          return page.mouse.up();
        }
        const send = (type: 'touchStart' | 'touchMove' | 'touchEnd', touchPoints: object[]) =>
          finger.send('Input.dispatchTouchEvent', { type, touchPoints: touchPoints as [] });
        await send('touchStart', [points[0]!]);
        for (const point of points) await send('touchMove', [point]);
        await send('touchEnd', []);
      };
      const before = await pose_of(page);
      await drag(0, 60, 120);
      await settle(page);
      expect(angle_between(before.orientation, (await pose_of(page)).orientation)).toBeGreaterThan(
        0.05,
      );
      const position = page.locator('#tour-position');
      expect(await position.innerText()).toBe('One stop');
      await page.getByRole('button', { name: 'Back to the start' }).click();
      await settle(page);
      await drag(0, 3);
      await expect.poll(() => position.innerText()).toBe('1 of 1');
      expect(errors).toEqual([]);
    },
  );
});
