// Pictures, films and sounds of a tour: an author adds them, and visitors see and hear them.
import { readFileSync, unlinkSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { BrowserContextOptions, Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { barriers } from './support/axe';
import { keep_screenshot, new_page, open, type WatchedPage } from './support/browser';
import { settle } from './support/camera';
import { captions, painted_film, tone } from './support/media_files';
import { painted_jpeg } from './support/painted';
import {
  access_token,
  catgs_render,
  start_server,
  type RunningServer,
  with_tokens,
} from './support/programs';
import { scratch_folder } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'hall.ply');
const windows: Readonly<Record<string, BrowserContextOptions>> = {
  desktop: { viewport: { width: 1280, height: 800 }, colorScheme: 'light' },
  phone: {
    viewport: { width: 390, height: 844 },
    hasTouch: true,
    isMobile: true,
    colorScheme: 'light',
  },
};

let server: RunningServer;
let jpeg: Buffer;
let film: Buffer;

beforeAll(async () => {
  catgs_render('synth', 'garden', scene, '--gaussians', '20000');
  unlinkSync(path.join(folder, 'hall.json'));
  server = await start_server(scene, [...with_tokens, '--min-fps', '0']);
  jpeg = Buffer.from(await painted_jpeg());
  film = await painted_film();
});

/** The address of the page by a link of the role. */
const link = (role: string, query = ''): string =>
  `${server.url}${query}#token=${access_token(role)}`;

/** A page whose visitor has not touched it yet, whatever the test has looked at. */
async function open_untouched(
  address: string,
  options?: BrowserContextOptions,
): Promise<WatchedPage> {
  const watched = await new_page(options, () =>
    Object.defineProperty(navigator, 'userActivation', { value: { hasBeenActive: false } }),
  );
  await watched.page.goto(address);
  await settle(watched.page);
  return watched;
}

interface Heard {
  readonly paused: boolean;
  readonly muted: boolean;
  readonly time_s: number;
}
const voice = (page: Page): Promise<Heard> =>
  page.locator('#tour > audio').evaluate((audio: HTMLAudioElement) => ({
    paused: audio.paused,
    muted: audio.muted,
    time_s: audio.currentTime,
  }));

describe('an author', () => {
  it('keeps two files that are sent at once, each in its field', async () => {
    const { page } = await open(link('author', '?author'), windows['desktop']);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByText('Pictures, films, voice').click();
    const release: (() => void)[] = [];
    await page.route('**/media/both*', async (route) => {
      await new Promise<void>((resolve) => release.push(resolve));
      await route.continue();
    });
    for (const label of ['Add a picture, film or sound', 'Voice']) {
      const sent = release.length;
      await page
        .locator(`input[type=file][aria-label="Upload: ${label}"]`)
        .setInputFiles({ name: 'both.wav', buffer: tone(1), mimeType: '' });
      await expect.poll(() => release.length).toBe(sent + 1);
    }
    release[0]!();
    await page.getByLabel('Captions of both.wav').first().waitFor(); // its fields are there, all are new
    release[1]!();
    const voice = page.getByLabel('Voice', { exact: true });
    await expect.poll(() => voice.inputValue()).toBe('both-2.wav');
  });

  it('adds a picture, a film, a voice and a sound', async () => {
    const { page, errors } = await open(link('author', '?author'), windows['desktop']);
    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByLabel('Title of stop 1').fill('The hall');
    await page.getByLabel('Caption of stop 1').fill('Its roof is of oak.');
    await page.getByText('Pictures, films, voice').click();
    const send = (label: string, name: string, buffer: Buffer): Promise<void> =>
      page
        .locator(`input[type=file][aria-label="Upload: ${label}"]`)
        .setInputFiles({ name, buffer, mimeType: '' });

    // The server's reason for a refusal is there, and nothing else has changed.
    await send(
      'Add a picture, film or sound',
      'drawing.png',
      Buffer.from('<svg xmlns="http://www.w3.org/2000/svg"/>'),
    );
    await page.getByText('Not added: drawing.png: is of no format').waitFor();
    await send('Add a picture, film or sound', 'The roof.jpg', jpeg);
    await page.getByLabel('What The-roof.jpg shows').fill('The roof seen from below');
    await send('Add a picture, film or sound', 'opening.webm', film);
    await page.getByLabel('What opening.webm shows').waitFor();
    await send('Voice', 'guide.wav', tone(20));
    await send('Captions of guide.wav', 'guide.vtt', Buffer.from(captions));
    await expect
      .poll(() => page.getByLabel('Captions of guide.wav', { exact: true }).inputValue())
      .toBe('guide.vtt');
    await page.getByText('More about the tour').click();
    await send('Sound of the tour', 'sea.wav', tone(3));
    await expect
      .poll(() => page.getByLabel('Sound of the tour', { exact: true }).inputValue())
      .toBe('sea.wav');
    await page.getByLabel('Volume').fill('0.4');
    // Germans hear and read others.
    await page.getByLabel('Texts for').selectOption('de');
    await send('Voice', 'deutsch.wav', tone(10));
    await expect
      .poll(() => page.getByLabel('Voice', { exact: true }).inputValue())
      .toBe('deutsch.wav');
    await send('Sound of the tour', 'meer.wav', tone(3));
    await expect
      .poll(() => page.getByLabel('Sound of the tour', { exact: true }).inputValue())
      .toBe('meer.wav');
    await page.getByText('About the scene').click();
    await page.locator('#about-title').fill('Die Halle');
    await keep_screenshot(page, 'media-author-german');
    await page.getByLabel('Texts for').selectOption('');
    await page.locator('#author-sound').scrollIntoViewIfNeeded();
    await keep_screenshot(page, 'media-author-sound');
    await page.getByLabel('What The-roof.jpg shows').scrollIntoViewIfNeeded();
    await keep_screenshot(page, 'media-author');
    expect(await barriers(page)).toEqual([]);

    await page.getByRole('button', { name: 'Add a stop here' }).click();
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors see it').waitFor();
    expect(errors.filter((error) => !error.includes('409'))).toEqual([]); // of the drawing
    const saved: unknown = JSON.parse(readFileSync(path.join(folder, 'hall.json'), 'utf8'));
    expect(saved).toHaveProperty('tours.0.stops.length', 2); // visitors get these
  });
});

describe('a visitor', () => {
  it('hears a voice and a sound in their own language, and reads the title so', async () => {
    const { page, errors } = await open(link('viewer'), { ...windows['desktop'], locale: 'de-DE' });
    await page.locator('#scene-name', { hasText: 'Die Halle' }).waitFor();
    await page.locator('#tour-next').click();
    const heard = (nth: string): Promise<string> =>
      page.evaluate((selector) => document.querySelector<HTMLAudioElement>(selector)!.src, nth);
    await expect.poll(() => heard('#tour > audio')).toContain('deutsch.wav');
    expect(errors).toEqual([]);
  });

  it.each(Object.keys(windows))('sees and hears them on a %s', async (name) => {
    const { page, errors } = await open_untouched(link('viewer'), windows[name]);
    const sound = page.locator('#button-sound');
    await sound.waitFor();
    expect(await sound.getAttribute('aria-label')).toBe('Sound on');
    await page.locator('#tour-next').click();
    const picture = page.getByAltText('The roof seen from below');
    await expect
      .poll(() => picture.evaluate((img: HTMLImageElement) => img.naturalWidth))
      .toBe(640);
    await expect.poll(async () => (await voice(page)).time_s).toBeGreaterThan(0);
    expect(await voice(page)).toMatchObject({ paused: false, muted: false });
    await expect
      .poll(() => page.locator('#tour-words').innerText())
      .toBe('This hall was built in 1904.');
    expect(await sound.getAttribute('aria-label')).toBe('Mute');
    await settle(page);
    await keep_screenshot(page, `media-visitor-${name}`);
    expect(await barriers(page)).toEqual([]);

    await sound.click();
    expect((await voice(page)).muted).toBe(true);
    await page.getByRole('button', { name: 'Pause the voice' }).click();
    expect((await voice(page)).paused).toBe(true);
    await sound.click();

    await picture.click();
    const dialog = page.getByRole('dialog', { name: 'The roof seen from below' });
    await dialog.waitFor();
    await keep_screenshot(page, `media-large-${name}`);
    expect(await barriers(page)).toEqual([]);
    await page.keyboard.press('Escape');
    await dialog.waitFor({ state: 'detached' });

    const shown = page.locator('#tour-media video');
    await shown.scrollIntoViewIfNeeded();
    await shown.evaluate((video: HTMLVideoElement) => video.play());
    await expect
      .poll(() => shown.evaluate((video: HTMLVideoElement) => video.currentTime))
      .toBeGreaterThan(0);
    expect(errors).toEqual([]);
  });

  it('hears nothing before the first touch, nor where the sound was turned off before', async () => {
    const { page } = await open_untouched(`${link('viewer')}&stop=1`, windows['desktop']);
    await page.locator('#tour-voice').waitFor();
    await page.waitForTimeout(300);
    expect(await voice(page)).toMatchObject({ paused: true, time_s: 0 });
    await page.mouse.click(600, 200);
    await expect.poll(async () => (await voice(page)).paused).toBe(false);
    await page.getByRole('button', { name: 'Mute' }).click();
    await page.reload();
    await settle(page);
    await page.getByRole('button', { name: 'Sound on' }).waitFor();
    await page.mouse.click(600, 200);
    await expect.poll(() => voice(page)).toMatchObject({ paused: false, muted: true });
    expect(await page.getByRole('button', { name: 'Sound on' }).isVisible()).toBe(true);
  });

  it.each(['de', 'ar'])('reads of them in %s', async (language) => {
    for (const [name, options] of Object.entries(windows)) {
      const { page, errors } = await open_untouched(link('viewer', `?lang=${language}`), options);
      await page.locator('#tour-next').click();
      await expect.poll(() => page.locator('#tour-words').innerText()).toContain('1904');
      await settle(page);
      await keep_screenshot(page, `media-${language}-${name}`);
      expect([await barriers(page), errors]).toEqual([[], []]);
    }
    const { page } = await open(link('author', `?author&lang=${language}`), windows['phone']);
    await page.locator('#author-stops details summary').first().click();
    await page.locator('#author-stops .media-choice').first().scrollIntoViewIfNeeded();
    await keep_screenshot(page, `media-author-${language}`);
    expect(await barriers(page)).toEqual([]);
  });

  it('finds words in place of what cannot be shown', async () => {
    const stops = [
      {
        title: 'Gone',
        position: [0, 0, -5],
        orientation: [0, 0, 0, 1],
        narration: { src: 'gone.mp3' },
        media: [
          { src: 'gone.jpg', alt: 'A lost picture' },
          { src: 'https://elsewhere.example/spy.jpg', alt: 'A foreign one' },
        ],
      },
    ];
    writeFileSync(
      path.join(folder, 'hall.json'),
      JSON.stringify({ tours: [{ stops: [...stops, ...stops] }] }),
    );
    const other = await start_server(scene);
    const { page } = await open(other.url, windows['desktop']);
    await page.locator('#tour-next').click();
    await page.getByText('A lost picture').waitFor();
    await page.getByText('A foreign one').waitFor(); // by the policy of the page
    await page.getByText('This cannot be shown or played here: Voice').waitFor();
    expect(await page.locator('#tour-media .missing').count()).toBe(2);
    await keep_screenshot(page, 'media-missing');
    expect(await barriers(page)).toEqual([]);
  });
});
