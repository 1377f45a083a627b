// Tours, links and frames against the real server, and the inputs that lead through a scene.
import { copyFileSync, mkdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { angle_between } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { keep_screenshot, new_page, open, windows, type WatchedPage } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { plug_in_gamepad } from './support/gamepad';
import { start_other_site } from './support/other_site';
import { catgs_render, start_server, type RunningServer } from './support/programs';
import { scratch_folder, write_tours } from './support/scenes';

const settings_file = fileURLToPath(
  new URL('../support/supersplat_settings.json', import.meta.url),
);
const folder = scratch_folder();
const scene = path.join(folder, 'city.ply');

let server: RunningServer;

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '30000');
  // Two stops between the start and the middle of the city, each with a hotspot ahead of it.
  write_tours(path.join(folder, 'city.json'), ({ focus, start_pose }) => {
    const between = (share: number): number[] =>
      start_pose.position.map((v, i) => v + (focus[i]! - v) * share);
    const stop = (title: string, caption: string, share: number) => ({
      title,
      caption,
      stay_s: 0.5,
      fov_deg: 60,
      position: between(share),
      look_at: focus,
      marker: between(share + 0.3),
    });
    const stops = [
      stop('From afar', 'The whole city, as a bird sees it.\nGo nearer by the arrow.', 0.1),
      stop('The square', 'Markets are held here since the town got its charter.', 0.4),
    ];
    return [{ title: 'A walk through the city', stops }];
  });
  // A second visitor gets in, however busy this machine is.
  server = await start_server(scene, ['--min-fps', '0']);
});

const turned = (a: Pose, b: Pose): number => angle_between(a.orientation, b.orientation);

describe('a tour', () => {
  it('leads from stop to stop, by buttons, keys and hotspots', async () => {
    const { page, errors } = await open(server.url, windows.desktop);
    await page.getByText('A walk through the city').first().waitFor();
    const start = await pose_of(page);
    await page.getByRole('button', { name: 'Next stop' }).click();
    await page.locator('#tour-text', { hasText: 'as a bird sees it' }).waitFor();
    await expect.poll(async () => distance(start, await pose_of(page))).toBeGreaterThan(0);
    await settle(page);
    const afar = await pose_of(page);
    await page.keyboard.press('PageDown');
    await page.getByText('2 of 2').waitFor();
    await settle(page);
    const square = await pose_of(page);
    expect(distance(afar, square)).toBeGreaterThan(0.1);
    await page.keyboard.press('PageUp');
    await page.getByText('1 of 2').waitFor();
    await settle(page);
    expect(distance(afar, await pose_of(page))).toBeLessThan(1e-3);
    await page.locator('.hotspot', { hasText: 'The square' }).click();
    await page.locator('#tour-text', { hasText: 'Markets are held' }).waitFor();
    await settle(page);
    expect(distance(square, await pose_of(page))).toBeLessThan(1e-3);
    expect(errors).toEqual([]);
  });

  it('tells of a stop before anybody goes there: to the mouse and to keys, not to a finger', async () => {
    const { page } = await open(server.url, windows.desktop);
    const spot = page.locator('.hotspot', { hasText: 'The square' });
    const label = spot.locator('.hotspot-label');
    const opacity = (): Promise<string> => label.evaluate((el) => getComputedStyle(el).opacity);
    await spot.waitFor();
    expect(await opacity()).toBe('0');
    await spot.hover();
    expect(await opacity()).toBe('1');
    expect(await label.innerText()).toContain('Markets are held here');
    const box = (await label.boundingBox())!;
    expect([
      box.x > 0,
      box.y > 0,
      box.x + box.width < 1280,
      box.y + box.height < 720,
    ]).not.toContain(false);
    await keep_screenshot(page, 'hotspot-hover');
    // It stays while the pointer is on it, and Escape hides it for visitors who want to see behind it.
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2, { steps: 8 });
    expect(await opacity()).toBe('1');
    await page.keyboard.press('Escape');
    expect(await opacity()).toBe('0');
    await page.mouse.move(10, 300);
    await spot.hover();
    expect(await opacity()).toBe('1');
    await page.mouse.move(10, 300);
    expect(await opacity()).toBe('0');
    await page.keyboard.press('Tab');
    await page.locator('#view').focus();
    for (let i = 0; i < 4 && (await opacity()) === '0'; ++i) await page.keyboard.press('Tab');
    expect(await opacity()).toBe('1');
    expect(await spot.evaluate((el) => el === document.activeElement)).toBe(true);
    // Its name is the title; the caption describes it.
    await page
      .getByRole('button', { name: 'The square', exact: true, description: /^Markets/ })
      .waitFor();
    await keep_screenshot(page, 'hotspot-keys');
    await page.keyboard.press('Enter');
    await page.getByText('2 of 2').waitFor();
    // The card shows the caption there.
    expect(await label.innerText()).not.toContain('Markets');

    const phone = await open(server.url, windows.phone);
    await phone.page.locator('.hotspot', { hasText: 'The square' }).tap();
    await phone.page.getByText('2 of 2').waitFor();
    await settle(phone.page);
    const shown = await phone.page
      .locator('.hotspot-label')
      .evaluateAll((all) => all.filter((el) => getComputedStyle(el).opacity !== '0').length);
    expect(shown).toBe(0);
    await keep_screenshot(phone.page, 'hotspot-phone');
  });

  it('plays by itself, until the visitor takes over', async () => {
    const { page } = await open(server.url, windows.desktop);
    await page.getByRole('button', { name: 'Play the tour' }).click();
    await page.getByText('1 of 2').waitFor();
    await page.getByText('2 of 2').waitFor();
    await page.getByText('1 of 2').waitFor();
    await page.mouse.move(320, 180);
    await page.mouse.wheel(0, -100);
    await page.getByRole('button', { name: 'Play the tour' }).waitFor();
  });

  it("is imported from the SuperSplat viewer's settings, films and all", async () => {
    const exported = path.join(folder, 'export', 'city.ply');
    mkdirSync(path.dirname(exported));
    copyFileSync(scene, exported);
    copyFileSync(settings_file, path.join(path.dirname(exported), 'settings.json'));
    const gallery = await start_server(exported);
    const { page } = await open(gallery.url, windows.desktop);
    const start = await pose_of(page);
    // A visit begins at its first camera. x and y have the opposite sign in that viewer.
    start.position.forEach((v, i) => expect(v).toBeCloseTo([-2, -1.5, -4][i]!, 4));
    const choice = page.getByLabel('Choose a tour');
    expect(await choice.locator('option').allInnerTexts()).toEqual(['Tour 1', 'cameraAnim']);
    await page.getByRole('button', { name: 'Next stop' }).click();
    await page.locator('#tour-text', { hasText: 'It squeaks.' }).waitFor();
    await choice.selectOption('cameraAnim');
    const before = await pose_of(page);
    await page.getByRole('button', { name: 'Play the tour' }).click();
    await expect.poll(async () => distance(before, await pose_of(page))).toBeGreaterThan(0.5);
    await page.getByRole('button', { name: 'Pause the tour' }).click();
    const paused = await pose_of(page);
    await settle(page);
    expect(distance(paused, await pose_of(page))).toBeLessThan(0.2);
  });

  it.each(Object.entries(windows))('looks right: %s', async (name, options) => {
    const { page } = await open(server.url, options);
    await page.getByRole('button', { name: 'Next stop' }).click();
    await page.getByText('1 of 2').waitFor();
    await settle(page);
    await keep_screenshot(page, `tour-${name}`);
    const outside = await page.evaluate(
      () =>
        [...document.querySelectorAll('#tour, #toolbar, #scene-title')].filter((element) => {
          const { left, right, top, bottom } = element.getBoundingClientRect();
          return left < 0 || top < 0 || right > innerWidth || bottom > innerHeight;
        }).length,
    );
    expect(outside).toBe(0);
    const [tour, bar] = await page.evaluate(() =>
      ['tour', 'toolbar'].map(
        (id) => document.getElementById(id)!.getBoundingClientRect().toJSON() as DOMRect,
      ),
    );
    const apart = tour!.right <= bar!.left || tour!.bottom <= bar!.top;
    expect(apart).toBe(true);
    await page.getByRole('button', { name: 'Share' }).click();
    expect(await page.locator('#share-token').isHidden()).toBe(true); // nobody needs one here
    await keep_screenshot(page, `share-${name}`);
  });
});

describe('a tour that waits at a stop with a long caption', () => {
  let patient: RunningServer;

  beforeAll(async () => {
    const other = path.join(folder, 'patient.ply');
    copyFileSync(scene, other);
    copyFileSync(path.join(folder, 'city.json'), path.join(folder, 'patient.json'));
    write_tours(path.join(folder, 'patient.json'), ({ focus, start_pose: { position } }) => {
      // The tower's marker is behind trees, the gate's on the street.
      const stop = (title: string, caption: string, marker: readonly number[]) => ({
        title,
        caption,
        marker,
        position,
        look_at: focus,
        stay_s: 60,
      });
      return [
        {
          title: 'Patience',
          stops: [
            stop('The tower', 'A long story. '.repeat(40), [-12, -1, 36]),
            stop('The gate', 'Closed.', [6, -1, 15]),
          ],
        },
      ];
    });
    patient = await start_server(other, ['--min-fps', '0']);
  });

  it.each(Object.entries({ desktop: windows.desktop, phone: windows.phone }))(
    'hides a hotspot while the scene is before it: %s',
    async (name, options) => {
      const { page, errors } = await open(patient.url, options);
      const shown = (title: string): Promise<boolean | undefined> =>
        page
          .locator('.hotspot', { hasText: title })
          .evaluate((spot: HTMLElement) =>
            spot.hidden ? undefined : spot.checkVisibility({ visibilityProperty: true }),
          );
      await expect.poll(() => shown('The tower')).toBe(false);
      expect(await shown('The gate')).toBe(true);
      await keep_screenshot(page, `hotspot-behind-${name}`);
      await page.evaluate(() => (location.hash = 'at=-12,-2,31,0,0,0,1,60'));
      await expect.poll(() => shown('The tower')).toBe(true);
      expect(errors).toEqual([]);
    },
  );

  it.each([
    ['the key R', (page: Page) => page.keyboard.press('KeyR')],
    ['a double click', (page: Page) => page.mouse.dblclick(640, 300)],
  ])('that stands at a stop is paused by %s', async (_what, act) => {
    const { page } = await open(patient.url, windows.desktop);
    await page.getByRole('button', { name: 'Play the tour' }).click();
    await page.getByText('1 of 2').waitFor();
    await settle(page);
    await act(page);
    await page.getByRole('button', { name: 'Play the tour' }).waitFor();
  });

  it.each([
    [640, 360],
    [480, 270],
    [360, 480],
  ])(
    'fits into a frame of %i x %i, and shows that its caption continues',
    async (width, height) => {
      const { page } = await open(`${patient.url}?ui=0#stop=1`, { viewport: { width, height } });
      const card = page.locator('#tour');
      await card.getByText('A long story.').waitFor();
      await keep_screenshot(page, `tour-frame-${width}x${height}`);
      const box = (await card.boundingBox())!;
      expect(box.height).toBeLessThan(0.7 * height);
      expect(box.x).toBeGreaterThanOrEqual(0);
      expect(box.x + box.width).toBeLessThanOrEqual(width);
      expect(box.y).toBeGreaterThanOrEqual(0);
      expect(box.y + box.height).toBeLessThanOrEqual(height);
      const goes_on = (): Promise<string | null> =>
        page.locator('#tour-text').getAttribute('class');
      await expect.poll(goes_on).toContain('more-below');
      await page.getByRole('button', { name: 'Next stop' }).click();
      await page.getByText('2 of 2').waitFor();
      await expect.poll(goes_on).not.toContain('more-below');
    },
  );
});

describe('sharing', () => {
  it('a link leads to the same view and stop, and carries no token', async () => {
    const { page } = await open(`${server.url}#token=not-needed-here`);
    await page.getByRole('button', { name: 'Next stop' }).click();
    await page.getByText('1 of 2').waitFor();
    await settle(page);
    await page.keyboard.press('KeyM');
    await page.getByRole('button', { name: 'Share' }).click();
    const link = await page.getByLabel('Link to this view').inputValue();
    expect(link).not.toContain('token');
    const { page: friend } = await open(link);
    await friend.locator('#mode-label', { hasText: 'Fly' }).waitFor();
    const [mine, theirs] = [await pose_of(page), await pose_of(friend)];
    expect(distance(mine, theirs)).toBeLessThan(0.01);
    expect(turned(mine, theirs)).toBeLessThan(0.001);
    await friend.getByText('1 of 2').waitFor();
    await friend.locator('#tour-text', { hasText: 'as a bird sees it' }).waitFor();
  });

  it('a link may name the mode alone', async () => {
    const { page } = await open(`${server.url}#mode=walk`);
    await page.locator('#mode-label', { hasText: 'Walk' }).waitFor();
  });

  it('a link to a place beyond the limits leads to the nearest within, and says so', async () => {
    const { page } = await open(`${server.url}#at=1e6,-20,0,0,0,0,1,60`);
    await page.getByText('That view is outside').waitFor();
    expect((await pose_of(page)).position[0]).toBeLessThan(1e5);
  });

  it('what a button answers moves nothing', async () => {
    const { page } = await open(server.url, windows.desktop);
    await page.getByRole('button', { name: 'Share' }).click();
    const button = page.getByRole('button', { name: 'Copy link' });
    const before = await button.boundingBox();
    await button.click();
    await page.locator('#share-done', { hasText: /\S/ }).waitFor();
    expect(await button.boundingBox()).toEqual(before);
  });

  it('says when no other page may show it', async () => {
    const { page, errors } = await open(server.url, windows.desktop);
    await page.getByRole('button', { name: 'Share' }).click();
    await page.getByRole('button', { name: 'Copy code for a web page' }).click();
    await page.getByText('The operator allows a site with --embed-origin').waitFor();
    await keep_screenshot(page, 'share-code-nobody');
    expect(errors).toEqual([]);
  });

  it('saves the picture', async () => {
    const { page, errors } = await open(server.url, windows.desktop);
    await page.getByRole('button', { name: 'Share' }).click();
    const download = page.waitForEvent('download');
    await page.getByRole('button', { name: 'Save picture' }).click();
    const file = await download;
    expect(file.suggestedFilename()).toBe('city.png');
    const bytes = readFileSync(await file.path());
    expect(bytes.subarray(1, 4).toString()).toBe('PNG');
    expect(errors).toEqual([]);
  });

  it('another page drives it in a frame, if the server lets it', async () => {
    const { origin } = await start_other_site('<iframe width="600" height="340"></iframe>');
    const open_frame = async (address: string): Promise<WatchedPage> => {
      const watched = await new_page();
      await watched.page.goto(origin);
      await watched.page.evaluate((src) => {
        const heard: unknown[] = [];
        Object.assign(window, { heard });
        window.addEventListener('message', ({ data }) => heard.push(data));
        document.querySelector('iframe')!.src = src;
      }, address);
      return watched;
    };
    const embeddable = await start_server(scene, ['--embed-origin', origin]);
    const { page } = await open_frame(`${embeddable.url}?ui=0`);
    const frame = page.frameLocator('iframe');
    await frame.getByRole('heading', { name: 'A walk through the city' }).waitFor();
    expect(await frame.locator('#toolbar').isHidden()).toBe(true);
    const say = (message: object): Promise<void> =>
      page.evaluate((text) => {
        document.querySelector('iframe')!.contentWindow!.postMessage(text, '*');
      }, message);
    const heard = (): Promise<{ catgs: string; stop?: number; stops?: string[] }[]> =>
      page.evaluate(() => (window as unknown as { heard: [] }).heard);
    await say({ catgs: 'hello' });
    await expect
      .poll(async () => (await heard())[0])
      .toMatchObject({ catgs: 'ready', scene: 'city', stops: ['From afar', 'The square'] });
    // The panel says who may use the code.
    const { page: sharing } = await open(embeddable.url, windows.desktop);
    await sharing.getByRole('button', { name: 'Share' }).click();
    expect(await sharing.locator('#share-frames').isHidden()).toBe(true);
    await sharing.getByRole('button', { name: 'Copy code for a web page' }).click();
    await sharing.getByText(`on pages of ${origin} only`).waitFor();
    await keep_screenshot(sharing, 'share-code');
    await say({ catgs: 'stop', stop: 1 });
    await frame.locator('#tour-text', { hasText: 'Markets are held' }).waitFor();
    await expect.poll(async () => (await heard()).some((m) => m.stop === 1)).toBe(true);
    await keep_screenshot(page, 'embedded');

    const { page: refused } = await open_frame(`${server.url}?ui=0`);
    await refused.waitForTimeout(1000);
    expect(await refused.frameLocator('iframe').locator('#view').count()).toBe(0);
  });
});

describe('ways to move', () => {
  it('a double click turns the view to the place, and goes nearer', async () => {
    const { page } = await open(`${server.url}#stop=1`, windows.desktop);
    await settle(page);
    const before = await pose_of(page);
    await page.mouse.dblclick(400, 220);
    await expect.poll(async () => turned(before, await pose_of(page))).toBeGreaterThan(0.02);
    await settle(page);
    const after = await pose_of(page);
    expect(distance(before, after)).toBeGreaterThan(0.1);
  });

  it('on foot the height stays, where no ground is known', async () => {
    const { page } = await new_page(windows.desktop);
    await page.route('**/walk', (route) => route.fulfill({ status: 204 }));
    await page.goto(`${server.url}#stop=1`);
    await settle(page);
    await page.keyboard.press('KeyM');
    await page.keyboard.press('KeyM');
    await page.locator('#mode-label', { hasText: 'Walk' }).waitFor();
    const before = await pose_of(page);
    await page.keyboard.down('KeyW');
    await expect.poll(async () => distance(before, await pose_of(page))).toBeGreaterThan(0.5);
    await page.keyboard.up('KeyW');
    expect((await pose_of(page)).position[1]).toBeCloseTo(before.position[1], 6);
  });

  it('a gamepad presses the buttons of the tour', async () => {
    const { page, errors } = await open(server.url);
    const set = await plug_in_gamepad(page);
    await set([0, 0, 0, 0], 0);
    await page.getByText('1 of 2').waitFor();
    expect(errors).toEqual([]);
  });

  it('a flick of the pointer continues for a moment, and not with reduced motion', async () => {
    for (const reducedMotion of ['no-preference', 'reduce'] as const) {
      const { page } = await open(server.url, {
        viewport: { width: 640, height: 360 },
        reducedMotion,
      });
      const lifted = await page.evaluate(async () => {
        const view = document.getElementById('view')!;
        const send = (type: string, clientX: number): void => {
          const init = { pointerId: 1, pointerType: 'mouse', clientX, clientY: 180, buttons: 1 };
          view.dispatchEvent(new PointerEvent(type, { ...init, bubbles: true }));
        };
        view.setPointerCapture = () => undefined;
        send('pointerdown', 100);
        for (let x = 110; x <= 200; x += 10) {
          await new Promise((resolve) => setTimeout(resolve, 8));
          send('pointermove', x);
        }
        send('pointerup', 200);
        return window.catgs!.pose();
      });
      await settle(page);
      const glided = turned(lifted, await pose_of(page));
      if (reducedMotion === 'reduce') expect(glided).toBeLessThan(0.3);
      else expect(glided).toBeGreaterThan(0.5);
    }
  });
});
