// What pages of other sites, links and texts of strangers do to the viewer in a real browser: nothing.
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { insecure_host, new_page, open as open_settled, type WatchedPage } from './support/browser';
import { pose_of, settle } from './support/camera';
import { start_other_site, type OtherSite } from './support/other_site';
import { catgs_render, start_server, type RunningServer } from './support/programs';
import { scratch_folder, write_tours } from './support/scenes';

// A file's name has no slash.
const hostile = '<img src=x onerror=document.body.dataset.taken=1><b>bold';
const folder = scratch_folder();
const scene = path.join(folder, `${hostile}.ply`);

let server: RunningServer;
let foreign: OtherSite;

beforeAll(async () => {
  catgs_render('synth', 'garden', scene, '--gaussians', '20000');
  write_tours(path.join(folder, `${hostile}.json`), ({ focus, start_pose }) => {
    const stop = (number: number) => ({
      title: `${hostile} ${number}`,
      caption: `${hostile}</p><script>document.body.dataset.taken=1</script>`,
      position: start_pose.position,
      look_at: focus,
      marker: focus,
    });
    return [{ title: hostile, stops: [stop(1), stop(2)] }];
  });
  foreign = await start_other_site('<iframe width="600" height="340"></iframe>');
  server = await start_server(scene, ['--min-fps', '0']);
});

async function open(url: string): Promise<WatchedPage> {
  const watched = await new_page();
  await watched.page.goto(url);
  return watched;
}

/** Nothing of what strangers wrote has become a part of the page. */
const taken = (page: Page): Promise<boolean> =>
  page.evaluate(
    () =>
      document.body.dataset['taken'] === '1' || document.querySelector('img[src="x"], b') !== null,
  );

/** Which of them succeed, from the page that is open. */
const attempts = (page: Page, target: string): Promise<string[]> =>
  page.evaluate(async (url) => {
    const shows = (): Promise<unknown> =>
      new Promise((resolve, reject) => {
        const image = new Image();
        image.onload = resolve;
        image.onerror = reject;
        image.src = `${url}favicon.svg`;
      });
    const connects = (): Promise<unknown> =>
      new Promise((resolve, reject) => {
        const socket = new WebSocket(url.replace('http', 'ws'), 'catgs.v1');
        socket.onopen = resolve;
        socket.onerror = reject;
      });
    const tries: Record<string, () => Promise<unknown>> = {
      read: () => fetch(`${url}api/scenes`),
      'read without CORS': () => fetch(`${url}api/scenes`, { mode: 'no-cors' }),
      save: () => fetch(`${url}api/scenes/any/sidecar`, { method: 'PUT', body: '{}' }),
      image: shows,
      websocket: connects,
    };
    const worked = await Promise.all(
      Object.entries(tries).map(([name, attempt]) =>
        attempt().then(
          () => name,
          () => undefined,
        ),
      ),
    );
    return worked.filter((name) => name !== undefined);
  }, target);

describe('a page of another site', () => {
  it('reads nothing, saves nothing and opens no connection', async () => {
    const { page: own } = await open(server.url);
    expect(await attempts(own, server.url)).toEqual([
      'read',
      'read without CORS',
      'save',
      'image',
      'websocket',
    ]);
    const { page } = await open(foreign.origin);
    expect(await attempts(page, server.url)).toEqual([]);
    expect(server.log()).toContain(`websocket refused: origin ${foreign.origin} is not allowed`);
  });

  it('has no name of its own for this server', async () => {
    const { page } = await open(server.url.replace('127.0.0.1', insecure_host));
    expect(await page.innerText('body')).toContain(`not known as ${insecure_host}`);
  });

  it('shows nothing of it in a frame', async () => {
    const { page, errors } = await open(foreign.origin);
    await page.evaluate((src) => {
      document.querySelector('iframe')!.src = src;
    }, server.url);
    await expect.poll(() => errors.join()).toContain('frame-ancestors');
    expect(await page.frameLocator('iframe').locator('#view').count()).toBe(0);
  });

  it('neither looks into a window with it nor steers it', async () => {
    const { page } = await open(foreign.origin);
    const opened = page.waitForEvent('popup');
    await page.evaluate((url) => Object.assign(window, { viewer: window.open(url) }), server.url);
    const viewer = await opened;
    await viewer.waitForURL(server.url);
    await settle(viewer);
    const before = await pose_of(viewer);
    const looked = await page.evaluate(() => {
      const { viewer: other } = window as unknown as { viewer: Window };
      const pose = { position: [1, 2, 3], orientation: [0, 0, 0, 1] };
      for (const message of [
        { catgs: 'hello' },
        { catgs: 'pose', ...pose },
        { catgs: 'stop', stop: 1 },
        '<b>',
      ]) {
        other.postMessage(message, '*');
      }
      try {
        return other.document.title;
      } catch (error) {
        return (error as Error).name;
      }
    });
    expect(looked).toBe('SecurityError');
    await settle(viewer);
    expect(await pose_of(viewer)).toEqual(before);
  });

  it('does not speak for the page that may show the viewer in a frame', async () => {
    const sneak = await start_other_site(
      `<script>parent.frames[0].postMessage({ catgs: 'stop', stop: 1 }, '*');</script>`,
    );
    const embeddable = await start_server(scene, [
      '--embed-origin',
      foreign.origin,
      '--min-fps',
      '0',
    ]);
    const { page, errors } = await open(foreign.origin);
    const frame = page.locator('iframe').first().contentFrame();
    await page.evaluate((src) => {
      document.querySelector('iframe')!.src = src;
    }, embeddable.url);
    await frame.getByRole('button', { name: 'Next stop' }).waitFor();
    await page.evaluate((src) => {
      document.body.append(Object.assign(document.createElement('iframe'), { src }));
    }, sneak.origin);
    await expect.poll(() => sneak.asked).toContain('/');
    const say = (message: unknown): Promise<void> =>
      page.evaluate(
        (data) => document.querySelector('iframe')!.contentWindow!.postMessage(data, '*'),
        message,
      );
    // Nor does the page itself say what it likes.
    for (const message of [
      { catgs: 'stop', stop: -1 },
      { catgs: 'pose', position: [hostile, NaN, Infinity], orientation: [0, 0, 0, 0] },
      { catgs: hostile },
      { catgs: 'constructor' },
      { catgs: { toString: 1 } },
      null,
    ]) {
      await say(message);
    }
    await say({ catgs: 'stop', stop: 0 });
    await frame.getByText('1 of 2').waitFor();
    expect(await frame.locator('#card').isHidden()).toBe(true);
    expect(errors).toEqual([]);
  });
});

it('an article scrolls over the frame until somebody clicks into it', async () => {
  const article = await start_other_site(
    '<iframe width="400" height="300"></iframe><p>Words<br style="line-height: 3000px"></p>',
  );
  const shown = await start_server(scene, ['--embed-origin', article.origin, '--min-fps', '0']);
  const { page } = await open(article.origin);
  await page.evaluate((src) => {
    document.querySelector('iframe')!.src = src;
    document.body.style.height = '3000px';
  }, shown.url);
  const frame = page.frames()[1]!;
  await frame.getByRole('button', { name: 'Next stop' }).waitFor();
  await settle(frame);
  const start = await pose_of(frame);
  const wheel_over_frame = async (): Promise<void> => {
    await page.evaluate('scrollTo(0, 0)');
    await page.mouse.move(200, 150); // over a hotspot
    await page.mouse.wheel(0, 100);
  };
  const scrolled = (): Promise<number> => page.evaluate(() => scrollY);
  await wheel_over_frame();
  await expect.poll(scrolled).toBeGreaterThan(0);
  await frame.getByText('Click or tap the picture').waitFor();
  expect(await pose_of(frame)).toEqual(start);
  await page.evaluate('scrollTo(0, 0)');
  await page.mouse.click(30, 200);
  await wheel_over_frame();
  await expect.poll(() => pose_of(frame)).not.toEqual(start);
  expect(await scrolled()).toBe(0);
  await page.mouse.click(500, 150);
  await wheel_over_frame();
  await expect.poll(scrolled).toBeGreaterThan(0);
});

describe('texts of strangers', () => {
  it.each([
    ['a token', `#token=${encodeURIComponent(hostile)}`],
    ['a scene in the fragment', `#scene=${encodeURIComponent(hostile)}`],
    ['a zero byte', '#token=%00'],
    ['half an escape', '#%'],
    ['nonsense', '#at=NaN,1e999,,0,0,0,0,0&mode=__proto__&tour=constructor&stop=99999999999'],
    ['a view from far away', '#at=1e8,1e8,1e8,0,0,0,1,160&stop=1&tour=2'],
    ['a megabyte', `#${'a'.repeat(1_000_000)}`],
    ['wishes', `?presenter=${encodeURIComponent(hostile)}&ui=__proto__`],
  ])('in an address: %s', async (_name, rest) => {
    const { page, errors } = await open_settled(server.url + rest);
    expect(await taken(page)).toBe(false);
    expect(await page.locator('#card').isHidden()).toBe(true);
    expect(errors).toEqual([]);
  });

  it('in the name of a scene that is not there', async () => {
    const { page, errors } = await open(`${server.url}?scene=${encodeURIComponent(`${hostile}!`)}`);
    await page.locator('#card-text', { hasText: `${hostile}!` }).waitFor();
    expect(await taken(page)).toBe(false);
    expect(errors).toEqual([expect.stringContaining('404')]); // of the poster
  });

  it('in the names and tours of a scene', async () => {
    const { page, errors } = await open(server.url);
    await page.getByRole('button', { name: 'Next stop' }).click();
    await page.locator('#tour-title', { hasText: `${hostile} 1` }).waitFor();
    expect(await page.locator('#tour-text').innerText()).toContain(`${hostile}</p><script>`);
    expect(await page.locator('.hotspot-label').first().textContent()).toContain(hostile);
    expect(await page.locator('#scene-name').textContent()).toContain('<img src=x');
    await page.getByRole('button', { name: 'Share' }).click();
    expect(await taken(page)).toBe(false);
    expect(errors).toEqual([]);
  });
});

it('what gets into the page all the same is stopped by the policy, and the page stays whole', async () => {
  const { page, errors } = await open_settled(server.url);
  const asked = foreign.asked.length;
  const violated = await page.evaluate(async (url) => {
    const directives: string[] = [];
    document.addEventListener('securitypolicyviolation', (event) =>
      directives.push(event.effectiveDirective),
    );
    const add = (html: string): void => {
      document.body.insertAdjacentHTML('beforeend', html);
    };
    add(
      `<img src="x" onerror="document.body.dataset.taken=1"><img src="${url}/image"><video src="${url}/film"></video>`,
    );
    add(
      `<iframe src="${url}/frame"></iframe><object data="${url}/object"></object><base href="${url}">`,
    );
    add(`<form action="${url}/form"><input name="a"></form><p style="color: red">`);
    for (const [name, value] of [
      ['textContent', 'document.body.dataset.taken=1'],
      ['src', `${url}/script`],
    ] as const) {
      document.body.append(Object.assign(document.createElement('script'), { [name]: value }));
    }
    document.querySelector<HTMLFormElement>('form[action]')!.submit();
    await fetch(`${url}/fetch`).catch(() => undefined);
    new WebSocket(`${url.replace('http', 'ws')}/socket`).onerror = () => undefined;
    await new Promise((resolve) => setTimeout(resolve, 500));
    return [...new Set(directives)].sort();
  }, foreign.origin);
  expect(violated).toEqual([
    ...[
      'base-uri',
      'connect-src',
      'form-action',
      'frame-src',
      'img-src',
      'media-src',
      'object-src',
    ],
    ...['script-src-attr', 'script-src-elem', 'style-src-attr'],
  ]);
  expect(errors.some((error) => error.includes('Content Security Policy'))).toBe(true);
  expect(await page.evaluate(() => document.body.dataset['taken'])).toBe(undefined);
  expect(foreign.asked.length).toBe(asked);
  await page.keyboard.press('PageDown');
  const place = (): Promise<string | null> =>
    page.evaluate(() => document.getElementById('tour-position')!.textContent);
  await expect.poll(place).toBe('1 of 2'); // locators would wait for the form to be sent
  await settle(page);
});
