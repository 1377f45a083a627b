// The page in Firefox, against the real server: the demo as deploy/run.sh serves it.
import path from 'node:path';
import { beforeAll, describe, expect, it } from 'vitest';
import { barriers } from './support/axe';
import { distance, pose_of, settle } from './support/camera';
import { open_in_firefox, start_firefox, type FirefoxPage } from './support/firefox';
import {
  access_token,
  catgs_render,
  start_server,
  type RunningServer,
  with_tokens,
} from './support/programs';
import { crop_streets, make_demo, scratch_folder } from './support/scenes';

const desktop = [1280, 800] as const;
const phone = [390, 844] as const;
const folder = scratch_folder();

let server: RunningServer;

beforeAll(async () => {
  await start_firefox();
  const city = make_demo(folder);
  const streets = path.join(scratch_folder(), 'streets.ply');
  crop_streets(city, streets, -38, 24);
  catgs_render('floors', streets, path.join(folder, 'city.walk'), '--eye-height', '1.6');
  server = await start_server(city, ['--scene-folder', folder, '--min-fps', '0', ...with_tokens]);
});

/** Opens the city. `at`: what the address says of the view. */
async function open(
  role: string,
  size: readonly [number, number],
  query = '',
  at = '',
): Promise<FirefoxPage> {
  const page = await open_in_firefox(
    `${server.url}?scene=city${query}#token=${access_token(role)}${at}`,
    ...size,
  );
  await settle(page);
  return page;
}

/** Keeps a picture of the page, and expects that nobody is kept out of it. */
async function look(page: FirefoxPage, name: string): Promise<void> {
  await settle(page);
  await page.keep_screenshot(`firefox-${name}`);
  // It has no WebXR.
  expect(await page.evaluate(() => document.getElementById('button-headset')!.hidden)).toBe(true);
  expect(await barriers(page)).toEqual([]);
}

const at_stop = (page: FirefoxPage, place: string): Promise<void> =>
  page.until(`document.getElementById('tour-position').textContent === '${place}'`);
const in_scene = (page: FirefoxPage, title: string): Promise<void> =>
  page.until(`document.getElementById('scene-name').textContent.startsWith('${title}')`);

/**
 * Goes on to the tower, and waits until the page shows its picture and says its words. It is muted, because
 * Firefox plays no voice aloud where there is no sound device.
 */
async function see_tower(page: FirefoxPage): Promise<void> {
  for (let k = 0; k < 2; ++k) await page.click('#button-sound'); // on, and off
  await page.click('#tour-next');
  await page.until(`document.querySelector('#tour-media img')?.naturalWidth > 0`);
  await page.until(`(document.querySelector('#tour > audio')?.currentTime ?? 0) > 0`);
  await page.until(`document.getElementById('tour-words').textContent !== ''`);
}

/** How many colours the floor plan has, when it is drawn. */
async function colours_of_plan(page: FirefoxPage): Promise<number> {
  await page.click('#button-plan');
  await page.until(`document.querySelector('#plan-panel [aria-busy=false]')`);
  return page.evaluate(() => {
    const canvas = document.querySelector<HTMLCanvasElement>('.plan-picture canvas')!;
    const { data } = canvas.getContext('2d')!.getImageData(0, 0, canvas.width, canvas.height);
    return new Set(new Uint32Array(data.buffer)).size;
  });
}

describe('Firefox', () => {
  it('shows video, turns and plays a tour', async () => {
    const page = await open('viewer', desktop);
    const start = await pose_of(page);
    expect(await page.evaluate('document.title')).toBe('Demo city – CaT-GS');
    await page.keep_screenshot('firefox');

    await page.drag([480, 300], [120, 40]);
    await settle(page);
    const turned = await pose_of(page);
    expect(
      Math.hypot(...turned.orientation.map((v, i) => v - start.orientation[i]!)),
    ).toBeGreaterThan(0.05);

    await page.click('#tour-play');
    await at_stop(page, '1 of 6');
    await at_stop(page, '2 of 6');
    await expect.poll(async () => distance(await pose_of(page), start)).toBeGreaterThan(0.5);
    await page.press('\uE00C'); // Escape
    await page.click('#tour-play');
    await settle(page);
    await page.keep_screenshot('firefox-tour');

    await page.press('i');
    await page.until(`document.querySelector('#stats-panel dl')`);
    expect(await page.evaluate<string>(`document.getElementById('stats-panel').innerText`)).toMatch(
      /x264|H\.264/,
    );
    await look(page, 'statistics');
    expect(page.errors).toEqual([]);
  });

  it('shows pictures and films, speaks, and leads through a portal and back', async () => {
    const page = await open('viewer', desktop, '', '&stop=3');
    await see_tower(page);
    await look(page, 'media');
    const muted = (): Promise<boolean> =>
      page.evaluate(`document.querySelector('#tour > audio').muted`);
    expect(await muted()).toBe(true);
    await page.click('#button-sound');
    expect(await muted()).toBe(false);

    await page.click('#tour-next');
    await page.until(`document.querySelector('#tour-media video')`);
    await page.evaluate(`document.querySelector('#tour-media video').play()`);
    await page.until(`document.querySelector('#tour-media video').currentTime > 0`);
    await look(page, 'film');

    await page.click('#tour-next');
    await at_stop(page, '6 of 6');
    await look(page, 'portal');
    await page.click('#tour-portal');
    await in_scene(page, 'Demo garden');
    await at_stop(page, '1 of 2');
    await page.until(`!document.querySelector('.cover')`);
    await look(page, 'garden');
    await page.evaluate('history.back()');
    await in_scene(page, 'Demo city');
    expect(page.errors).toEqual([]);
  });

  it('walks, shows the floor plan and measures', async () => {
    const page = await open('viewer', desktop, '', '&stop=3&mode=walk');
    await page.until(`!document.getElementById('button-plan').hidden`);
    expect(await colours_of_plan(page)).toBeGreaterThan(4);
    await look(page, 'plan');
    const begin = await pose_of(page);
    await page.click([640, 640]);
    await expect.poll(async () => distance(begin, await pose_of(page))).toBeGreaterThan(0.5);
    await settle(page);
    await page.keep_screenshot('firefox-walked');

    await page.click('#button-measure');
    await page.until(`document.querySelector('#measure-results p')`);
    await page.click([500, 640]);
    await page.click('#measure-middle');
    await page.until(`/\\d/.test(document.querySelector('#measure-results dd')?.innerText)`);
    await look(page, 'measure');
    expect(page.errors).toEqual([]);
  });

  it.each([
    ['de', 'ltr'],
    ['ar', 'rtl'],
  ])('reads %s, on a phone', async (language, direction) => {
    const page = await open('viewer', phone, `&lang=${language}`, '&stop=3');
    expect(
      await page.evaluate(() => [
        document.documentElement.lang,
        getComputedStyle(document.body).direction,
      ]),
    ).toEqual([language, direction]);
    await see_tower(page);
    await look(page, `media-${language}`);
    expect(await colours_of_plan(page)).toBeGreaterThan(4);
    await look(page, `plan-${language}`);
    expect(page.errors).toEqual([]);
  });

  it('orders a picture for an author', async () => {
    const page = await open('author', desktop, '&author', '&stop=4');
    await page.click('#author-film summary');
    await page.until(`document.querySelector('#author-film .primary')?.hidden === false`);
    await page.click('#author-film .primary');
    await page.until(`document.querySelector('#author-film a[download]')?.hidden === false`);
    await page.evaluate(`document.querySelector('#author-film a[download]').scrollIntoView()`);
    await look(page, 'still');
    expect(page.errors).toEqual([]);
  });
});
