// The page in each situation, against a server that follows a script.
import { readdir, readFile } from 'node:fs/promises';
import path from 'node:path';
import { gzipSync } from 'node:zlib';
import { beforeAll, describe, expect, it } from 'vitest';
import { languages } from '#client/text/language';
import { Error_Code } from '#client/wire/wire';
import { keep_screenshot, new_page, open } from './support/browser';
import { settle } from './support/camera';
import { refuse, start_fake_server, web_dist, type Script } from './support/fake_server';
import { painted_jpeg, stream_of } from './support/painted';

const scenes = [
  { id: 'city', title: 'Demo city' },
  { id: 'hall', title: 'The hall', credits: 'Ada', licence: 'MIT' },
  { id: 'garden', title: 'garden' },
];
let stream: Script;

beforeAll(async () => {
  stream = stream_of(await painted_jpeg());
});

describe('files', () => {
  it('are small, and nothing is inline that the policy of the server would block', async () => {
    const folder = path.join(web_dist, 'assets');
    const files = (await readdir(folder)).map((name) => path.join(folder, name));
    const index = await readFile(path.join(web_dist, 'index.html'), 'utf8');
    const packed = await Promise.all(
      files.map(
        async (file) => [path.basename(file), gzipSync(await readFile(file)).length] as const,
      ),
    );
    type Kind = 'language' | 'first' | 'visitors' | 'headset' | 'tools';
    const kind_of = (file: string): Kind => {
      if (languages.some((language) => file.startsWith(`${language}-`))) return 'language';
      if (index.includes(file) || file.startsWith('worker-')) return 'first';
      if (file.startsWith('headset-')) return 'headset';
      return /^(stats_panel|stats_charts|author_page|film_panel|console)-/.test(file)
        ? 'tools'
        : 'visitors';
    };
    const sizes = (kind: Kind): number[] =>
      packed.flatMap(([file, bytes]) => (kind_of(file) === kind ? [bytes] : []));
    const total = (...all: number[]): number => all.reduce((sum, bytes) => sum + bytes, 0);
    const first = total(gzipSync(index).length, ...sizes('first'));
    const visitors = total(first, ...sizes('visitors'));
    const all = total(visitors, ...sizes('tools'));
    const kilobytes = (bytes: number): string => (bytes / 1000).toFixed(1);
    console.log(
      `the page loads ${kilobytes(first)} kB (gzip), ${kilobytes(visitors)} kB when a visitor uses all of it, ` +
        `${kilobytes(all)} kB with statistics and the editor; languages: ${sizes('language').join(', ')}`,
    );
    expect(first).toBeLessThanOrEqual(94_800);
    expect(total(...sizes('headset'))).toBeLessThanOrEqual(15_400);
    expect(visitors).toBeLessThanOrEqual(148_500);
    expect(all).toBeLessThanOrEqual(188_600);
    expect(sizes('language')).toHaveLength(languages.length - 1); // English is part of the page
    expect(Math.max(...sizes('language'))).toBeLessThanOrEqual(8_000);
    expect(index).not.toMatch(/<style|\sstyle=|\son[a-z]+=|<script(?![^>]*\ssrc=)/);
    expect(index).not.toMatch(/https?:\/\//);
  });
});

describe('page', () => {
  it('shows the picture, acknowledges it and reports statistics', async () => {
    const server = await start_fake_server(stream);
    const { page, errors } = await open(server.url);
    expect(await page.locator('#card').isHidden()).toBe(true);
    await page.keyboard.press('KeyI');
    await page.locator('#stats-panel').getByText('mjpeg').waitFor();
    await keep_screenshot(page, 'fake-streaming');
    const heard = server.peers[0]!.heard;
    // A busy machine may drop the first of the two pictures.
    const acks = heard.flatMap((body) => (body.case === 'ack' ? [body.value.dropped] : []));
    expect(acks).toContain(false);
    expect(errors).toEqual([]);
  });

  it('keeps the last picture while the server is away, and says so', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    await server.close();
    await page.getByText('The server does not answer').waitFor();
    const { width_px } = await page.evaluate(() => window.catgs!.snapshot());
    expect(width_px).toBe(640);
  });

  it('says that the server is updated when it was told so', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    server.peers[0]!.say({ case: 'drain', value: { deadlineMs: 1000 } });
    await server.close();
    await page.getByText('The server is being updated').waitFor();
    await keep_screenshot(page, 'updating');
  });

  it('says that a part of it has not loaded, and tries again', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    let tries = 0;
    await page.route('**/stats_charts-*.js', (route) =>
      tries++ === 0 ? route.abort() : route.continue(),
    );
    await page.keyboard.press('KeyI');
    const told = page.getByText('Part of this page has not loaded');
    await told.waitFor();
    await keep_screenshot(page, 'part-missing');
    await page.locator('#stats-panel .uplot').last().waitFor();
    expect(await told.isVisible()).toBe(false);
  });

  it('shows the scene to an author whose editor has not loaded, and tries again', async () => {
    const server = await start_fake_server(stream);
    const { page } = await new_page();
    let is_away = true;
    await page.route('**/author_page-*.js', (route) =>
      is_away ? route.abort() : route.continue(),
    );
    await page.goto(`${server.url}?author`);
    await page.locator('#card').waitFor({ state: 'hidden' });
    await page.getByText('Part of this page has not loaded').waitFor();
    is_away = false;
    await page.getByRole('region', { name: 'Make a tour' }).waitFor();
  });

  it('says that a browser is too old only when the script does not come', async () => {
    const server = await start_fake_server(stream);
    const { page } = await new_page();
    await page.route('**/*.js', () => undefined); // never answered
    await page.goto(server.url, { waitUntil: 'commit' });
    const stays = page.getByText('the browser is too old');
    await page.getByRole('heading', { name: 'Loading' }).waitFor();
    expect(await stays.isVisible()).toBe(false);
    await stays.waitFor();
  });

  it('asks for a token when its own is refused, and uses the one that is entered', async () => {
    const server = await start_fake_server((peer, body) => {
      const is_wrong = body.case === 'hello' && body.value.token !== 'right';
      (is_wrong ? refuse(Error_Code.UNAUTHORIZED, 'the access token is not valid') : stream)(
        peer,
        body,
      );
    });
    const { page } = await new_page();
    await page.goto(`${server.url}#token=wrong`);
    await page.getByText('Access token needed').waitFor();
    await keep_screenshot(page, 'fake-token');
    // There is nothing to control yet, so neither buttons nor keys work.
    await page.keyboard.press('KeyH');
    expect(await page.locator('#help-panel').isHidden()).toBe(true);
    expect(await page.locator('#toolbar').getAttribute('inert')).not.toBeNull();
    expect(page.url()).not.toContain('token');
    await page.getByLabel('Access token').fill('right');
    await page.getByRole('button', { name: 'Connect' }).click();
    await settle(page);
    expect(await page.locator('#toolbar').getAttribute('inert')).toBeNull();
    await page.getByRole('button', { name: 'Share' }).click();
    await page.getByText('does not contain your access token').waitFor();
    expect(await page.getByLabel('Link to this view').inputValue()).not.toContain('right');
    await keep_screenshot(page, 'fake-token-share');
  });

  it('leads from a scene that does not exist to those that do', async () => {
    const server = await start_fake_server(
      (peer, body) => {
        const is_wrong = body.case === 'hello' && body.value.sceneId === 'nope';
        (is_wrong ? refuse(Error_Code.UNKNOWN_SCENE, 'there is no scene "nope" here') : stream)(
          peer,
          body,
        );
      },
      { scenes },
    );
    const { page } = await new_page();
    await page.goto(`${server.url}?scene=nope`);
    await page.getByText('No such scene').waitFor();
    await page.getByRole('link', { name: 'garden' }).click();
    await page.waitForURL(`${server.url}?scene=garden`);
    await settle(page);
  });

  it('shows several scenes first, and leads back to them', async () => {
    const server = await start_fake_server(stream, { scenes });
    const { page } = await new_page();
    await page.goto(`${server.url}?author`);
    await page.getByRole('heading', { name: 'Scenes' }).waitFor();
    expect(await page.getByRole('link').allInnerTexts()).toEqual([
      'Demo city',
      expect.stringMatching(/^The hall\s+Ada · MIT$/),
      'garden',
    ]);
    expect(server.peers).toEqual([]); // no slot is taken
    await page.keyboard.press('Tab');
    await page.keyboard.press('Enter');
    await page.waitForURL(`${server.url}?author=&scene=city`);
    await settle(page);
    await page.getByRole('link', { name: 'All scenes' }).focus();
    await page.keyboard.press('Enter');
    await page.getByRole('heading', { name: 'Scenes' }).waitFor();
  });

  it('goes to a view, and into a frame, without a choice of scenes', async () => {
    const server = await start_fake_server(stream, { scenes });
    for (const way of ['?ui=0', '#stop=1', '#mode=fly&at=0,0,-4,0,0,0,1,60']) {
      const { page } = await open(server.url + way);
      await page.close();
    }
    expect(server.peers.map((peer) => peer.heard[0]?.value)).toEqual(
      Array(3).fill(expect.objectContaining({ sceneId: 'city' })),
    );
  });

  it('frames the view for who came by Tab, not for who clicked and flies', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    const framed = (): Promise<boolean> =>
      page.evaluate(
        () => getComputedStyle(document.querySelector('#view')!, '::after').content !== 'none',
      );
    await page.mouse.click(200, 200);
    await page.keyboard.press('KeyW');
    expect(await framed()).toBe(false);
    await page.keyboard.press('Tab');
    await page.keyboard.press('Shift+Tab');
    expect(await framed()).toBe(true);
  });

  it('has each panel right after its button for the keyboard, and gives the focus back', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    const button = page.getByRole('button', { name: 'Share' });
    await button.focus();
    await page.keyboard.press('Enter');
    await page.keyboard.press('Tab');
    expect(
      await page
        .getByLabel('Link to this view')
        .evaluate((link: Element) => link === document.activeElement),
    ).toBe(true);
    await page.keyboard.press('Tab');
    await page.keyboard.press('Escape');
    expect(await page.locator('#share-panel').isHidden()).toBe(true);
    expect(await button.evaluate((element) => element === document.activeElement)).toBe(true);
  });

  it('has the position in the queue in its title, and calls visitors who look elsewhere', async () => {
    let admit = (): void => undefined;
    const server = await start_fake_server((peer, body) => {
      if (body.case !== 'hello') return stream(peer, body);
      peer.say({ case: 'queue', value: { position: 2, estimateS: 45 } });
      admit = () => stream(peer, body);
    });
    const { page, errors } = await new_page(undefined, () => {
      const told = { tones: 0 };
      const nodes = AudioScheduledSourceNode.prototype;
      const { start } = Object.getOwnPropertyDescriptors(nodes);
      nodes.start = function (when) {
        told.tones += 1;
        start.value!.call(this, when);
      };
      Document.prototype.hasFocus = () => !('elsewhere' in told);
      Object.assign(window, { told });
    });
    const told = (): Promise<number> => page.evaluate('window.told.tones');
    await page.goto(server.url);
    await expect.poll(() => page.title()).toBe('(2) CaT-GS');
    server.peers[0]!.say({ case: 'queue', value: { position: 1, estimateS: 20 } });
    await expect.poll(() => page.title()).toBe('(1) CaT-GS');
    const call_me = page.getByRole('button', { name: 'Call me when it is my turn' });
    await call_me.click();
    await page.getByRole('status').getByText('This sound tells you').waitFor();
    expect(await call_me.isHidden()).toBe(true);
    expect(await told()).toBe(2);
    await page.evaluate('window.told.elsewhere = true');
    admit();
    await page.getByRole('status').getByText('It is your turn.', { exact: true }).waitFor();
    expect(await told()).toBe(4);
    await expect.poll(() => page.title()).toBe('Your turn – Demo city – CaT-GS');
    await page.evaluate('delete window.told.elsewhere; window.dispatchEvent(new Event("focus"))');
    expect(await page.title()).toBe('Demo city – CaT-GS');
    expect(errors).toEqual([]);
  });

  it('loses no key that is pressed before the scene is there', async () => {
    let admit = (): void => undefined;
    const admitted = new Promise<void>((resolve) => (admit = resolve));
    const server = await start_fake_server((peer, body) => {
      if (body.case === 'hello') void admitted.then(() => stream(peer, body));
      else stream(peer, body);
    });
    const { page } = await new_page();
    await page.goto(server.url);
    await page.waitForFunction(() => window.catgs !== undefined);
    await page.keyboard.press('KeyM');
    await page.locator('#mode-label', { hasText: 'Fly' }).waitFor();
    await page.keyboard.press('KeyW');
    admit();
    await settle(page);
    const { position } = await page.evaluate(() => window.catgs!.pose());
    expect(position).not.toEqual([0, 0, -5]); // where visits begin
  });

  it('keeps the last figures at rest, when nothing is measured', async () => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url);
    await page.keyboard.press('KeyI');
    const render = page.locator('#stats-panel dt:text-is("Render") + dd');
    await expect.poll(() => render.innerText()).toBe('20.0 ms');
    const kept = (): Promise<number> => page.locator('#stats-panel .kept').count();
    await expect.poll(kept).toBeGreaterThan(5);
    expect(await render.innerText()).toBe('20.0 ms');
    await page.keyboard.press('KeyW');
    await expect.poll(kept).toBeLessThan(5);
  });

  it.each([
    { width: 360, height: 740 },
    { width: 740, height: 360 },
  ])('shows one panel at a time on a phone of %o, and how to reach its end', async (viewport) => {
    const server = await start_fake_server(stream);
    const { page } = await open(server.url, { viewport, hasTouch: true, isMobile: true });
    const panels = (): Promise<string[]> =>
      page.evaluate(() =>
        [...document.querySelectorAll('.panel:not([hidden])')].map((panel) => panel.id),
      );
    await page.getByRole('button', { name: 'Statistics' }).tap();
    await page.getByRole('button', { name: 'Controls' }).tap();
    expect(await panels()).toEqual(['help-panel']);
    expect(await page.getByText('Keys').isHidden()).toBe(true);
    await page.getByRole('button', { name: 'Statistics' }).tap();
    expect(await panels()).toEqual(['stats-panel']);
    const panel = page.locator('#stats-panel');
    const goes_on = (): Promise<boolean> =>
      panel.evaluate((e) => e.classList.contains('more-below'));
    await expect.poll(() => panel.locator('.uplot canvas').count()).toBe(2);
    await expect.poll(goes_on).toBe(true);
    await panel.evaluate((e) => e.scrollTo(0, e.scrollHeight));
    await expect.poll(goes_on).toBe(false);
  });
});
