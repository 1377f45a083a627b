// Real devices and browsers do this to a page: keep it, end its decoders and its GPU, run foreign scripts in it.
import { readFileSync } from 'node:fs';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { Error_Code } from '#client/wire/wire';
import { keep_screenshot, launch_browser, new_page, open, windows } from './support/browser';
import { settle } from './support/camera';
import { clean_up } from './support/clean_up';
import { start_fake_server, type FakeServer, type Peer, type Script } from './support/fake_server';
import { painted_jpeg, stream_of } from './support/painted';

const scenes = ['city', 'hall', 'garden', 'tower'].map((id) => ({ id, title: id }));
let jpeg: Uint8Array;
let stream: Script;

beforeAll(async () => {
  jpeg = await painted_jpeg();
  stream = stream_of(jpeg);
});

const bodies = (peer: Peer, kind: string): unknown[] =>
  peer.heard.flatMap((body) => (body.case === kind ? [body.value] : []));

describe('a browser that keeps the pages one leaves', () => {
  /** The pages that were left, and the last one. Their peers are those of the server, in order. */
  async function browse(server: FakeServer): Promise<Page> {
    const browser = await launch_browser(['--disable-back-forward-cache']);
    clean_up(() => browser.close());
    const page = await browser.newPage();
    for (const { id } of scenes) {
      await page.goto(`${server.url}?scene=${id}`);
      await settle(page);
      if (id === 'city') await page.keyboard.press('ArrowLeft');
      await settle(page);
      await page.evaluate((name) => Object.assign(window, { kept: name }), id);
    }
    return page;
  }

  it('keeps no visit for them, and one comes back where it was', async () => {
    const server = await start_fake_server(stream, { scenes });
    const page = await browse(server);
    await expect
      .poll(() => server.peers.map((peer) => bodies(peer, 'bye').length))
      .toEqual([1, 1, 1, 0]);
    for (let i = 1; i < scenes.length; ++i) await page.goBack({ waitUntil: 'commit' }); // a kept page does not load
    expect(await page.evaluate('window.kept')).toBe('city'); // the browser has kept the page
    await expect.poll(() => server.peers.length).toBe(7);
    const [first, back] = [server.peers[0]!, server.peers.at(-1)!];
    await expect.poll(() => bodies(back, 'hello')).toMatchObject([{ sceneId: 'city' }]);
    expect(bodies(back, 'hello')).toMatchObject([
      { resume: { token: 'resume-me', pose: bodies(first, 'pose').at(-1) } },
    ]);
    await page.keyboard.press('ArrowLeft');
    await settle(page);
    expect(await page.locator('#card').isHidden()).toBe(true);
  });
});

describe('a lost GPU context', () => {
  const remember_context = `{
    const get = OffscreenCanvas.prototype.getContext;
    OffscreenCanvas.prototype.getContext = function (...of) {
      return (self.context = get.apply(this, of));
    };
  }`;

  it.each([
    ['webgl2', 'webglcontextrestored'],
    ['2d', 'contextrestored'],
  ])('of %s is painted again without a movement', async (presenter, restored) => {
    const server = await start_fake_server(
      (peer, body) => {
        if (body.case === 'hello') {
          const beat = setInterval(() => peer.say({ case: 'heartbeat', value: {} }), 1000);
          clean_up(() => clearInterval(beat));
        }
        // A server draws no pose twice, unless somebody asks for a key frame.
        const [pose, before] = bodies(peer, 'pose').reverse() as { poseId: bigint }[];
        if (body.case === 'requestIdr') stream(peer, { case: 'pose', value: pose as never });
        else if (body.case !== 'pose' || pose?.poseId !== before?.poseId) stream(peer, body);
      },
      { before_worker: remember_context },
    );
    const { page, errors } = await open(`${server.url}?presenter=${presenter}`);
    const [worker] = page.workers();
    await worker!.evaluate(async (event) => {
      const { context } = self as unknown as { context: WebGL2RenderingContext };
      const { canvas } = context;
      const back = new Promise((resolve) => canvas.addEventListener(event, resolve));
      if ('isContextLost' in context && 'getExtension' in context) {
        const loss = context.getExtension('WEBGL_lose_context')!;
        loss.loseContext();
        setTimeout(() => loss.restoreContext(), 50);
      } else {
        canvas.width += 0; // empties it, as a lost GPU does
        canvas.dispatchEvent(new Event(event));
      }
      await back;
    }, restored);
    const is_painted = (): Promise<boolean> =>
      page.evaluate(async () => {
        const { rgba } = await window.catgs!.snapshot();
        return rgba.some((value, i) => i % 4 !== 3 && value > 0);
      });
    await expect.poll(is_painted).toBe(true);
    expect(errors).toEqual([]);
  });
});

describe('a window that moves to a finer screen', () => {
  it('gets finer pictures, though its size in CSS pixels stays', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    const sizes = (): unknown => bodies(server.peers[0]!, 'settings').at(-1);
    const session = await page.context().newCDPSession(page);
    for (const [deviceScaleFactor, width, height] of [
      [2, 1280, 720],
      [1, 640, 360],
    ] as const) {
      const screen = { width: 640, height: 360, deviceScaleFactor, mobile: false };
      await session.send('Emulation.setDeviceMetricsOverride', screen);
      await expect.poll(sizes).toMatchObject({ stillWidthPx: width, stillHeightPx: height });
    }
  });
});

describe('a phone', () => {
  it('types in letters that it need not enlarge', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(`${server.url}?author`, windows.phone);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    const small = await page.evaluate(() =>
      [...document.querySelectorAll('input, select, textarea')]
        .filter((field) => parseFloat(getComputedStyle(field).fontSize) < 16)
        .map((field) => field.outerHTML),
    );
    expect(small).toEqual([]);
    await keep_screenshot(page, 'phone-fields');
  });

  const tours = [
    {
      title: 'A walk',
      stops: ['Short.', 'A long story. '.repeat(30)].map((caption) => ({
        title: 'The gate',
        caption,
        position: [0, 0, -5],
        look_at: [0, 0, 0],
        marker: [0, 1.1, -2],
      })),
    },
  ];

  it('leaves no button grey that a finger has touched', async () => {
    const server = await start_fake_server(stream, { tours });
    const { page } = await open(server.url, windows.phone);
    const next = page.getByRole('button', { name: 'Next stop' });
    await next.tap();
    await page.getByText('1 of 2').waitFor();
    expect(await next.evaluate((button) => getComputedStyle(button).backgroundColor)).toBe(
      'rgba(0, 0, 0, 0)',
    );
  });

  it.each([
    [390, 844, '#stop=1'],
    [360, 640, '#stop=2'],
    [740, 360, '#stop=2'],
    [390, 420, '?ui=0#stop=1'],
    [430, 420, '?ui=0#stop=2'],
  ])(
    'of %i x %i sees the hotspot and the title beside the card: %s',
    async (width, height, rest) => {
      const server = await start_fake_server(
        (peer, body) => {
          stream_of(jpeg, { title: 'A very long title of the demo city', credits: 'Ada Lovelace' })(
            peer,
            body,
          );
          if (body.case === 'markers')
            peer.say({ case: 'hiddenMarkers', value: { id: body.value.id, indices: [0, 1] } });
        },
        { tours },
      );
      const viewport = { width, height };
      const { page, errors } = await open(`${server.url}${rest}`, { ...windows.phone, viewport });
      const hotspot = page.locator('.hotspot[aria-current]');
      await expect(hotspot.getAttribute('class')).resolves.toContain('behind');
      const card = page.locator('#tour');
      for (const lines of ['', 'A line. '.repeat(30)]) {
        await card.locator('h2').evaluate((title, more) => title.append(more), lines); // the card grows
        await expect
          .poll(async () => {
            const [spot, covered, title] = (await Promise.all(
              [hotspot, card, page.locator('#scene-title')].map((element) => element.boundingBox()),
            )) as { x: number; y: number; width: number; height: number }[];
            const apart = (a: typeof spot, b: typeof spot): boolean =>
              a!.x + a!.width <= b!.x ||
              b!.x + b!.width <= a!.x ||
              a!.y + a!.height <= b!.y ||
              b!.y + b!.height <= a!.y;
            return [apart(spot, covered), apart(title, covered)];
          })
          .toEqual([true, true]);
      }
      expect(
        await hotspot.evaluate((spot) => spot.checkVisibility({ visibilityProperty: true })),
      ).toBe(true);
      await keep_screenshot(page, `hotspot-beside-card-${width}x${height}`);
      expect(errors).toEqual([]);
    },
  );
});

describe('an error', () => {
  const throw_from = (page: Page, file: string): Promise<void> =>
    page.evaluate((filename) => {
      window.dispatchEvent(new ErrorEvent('error', { message: 'a planted fault', filename }));
    }, file);
  const own_file = (page: Page): Promise<string> =>
    page.locator('script[type=module]').evaluate((script: HTMLScriptElement) => script.src);

  it('of a foreign script ends nothing, whenever it comes', async () => {
    const server = await start_fake_server(stream);
    const { page } = await new_page();
    await page.goto(server.url);
    const foreign = async (): Promise<void> => {
      for (const file of ['', server.url, 'chrome-extension://translator/content.js'])
        await throw_from(page, file);
      await page.evaluate(() => void Promise.reject(new Error('of an in-app browser')));
    };
    await foreign();
    await settle(page);
    await foreign();
    await page.keyboard.press('ArrowLeft');
    await settle(page);
    expect(await page.locator('#card').isHidden()).toBe(true);
    expect(await page.locator('#notice').isHidden()).toBe(true);
    expect(server.peers).toHaveLength(1);
  });

  it('of the page itself is told once, and a page with a picture goes on', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    await throw_from(page, await own_file(page));
    await page.locator('#notice').getByText('A planted fault. Reload it.').waitFor();
    await page.locator('#notice-close').click();
    await throw_from(page, await own_file(page));
    await page.keyboard.press('ArrowLeft');
    await settle(page);
    expect(await page.locator('#notice').isHidden()).toBe(true);
    expect(bodies(server.peers[0]!, 'bye')).toEqual([]);
  });

  it('of the page itself ends it where it has shown nothing yet', async () => {
    const server = await start_fake_server(() => undefined);
    const { page } = await new_page();
    await page.goto(server.url);
    await throw_from(page, await own_file(page));
    await page.getByText('This page ran into an error').waitFor();
    await page.getByRole('button', { name: 'Reload' }).waitFor();
  });

  it('of the server leaves authors their unsaved work', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(`${server.url}?author`);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByRole('textbox', { name: 'Title of stop 1' }).fill('The hall');
    server.peers[0]!.say({
      case: 'error',
      value: { code: Error_Code.UNSUPPORTED_VERSION, message: 'updated', fatal: true },
    });
    await page.getByText('This page does not match the server').waitFor();
    const saved = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Download the file' }).click();
    expect(readFileSync(await (await saved).path(), 'utf8')).toContain('The hall');
    await keep_screenshot(page, 'unsaved-work');
  });
});
