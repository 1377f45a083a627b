// Shared tours: one page presents, others follow its camera or watch its pictures. Against the real server.
import { copyFileSync, mkdirSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { barriers } from './support/axe';
import { keep_screenshot, new_page, open, windows } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { present } from './support/shared_tour';
import {
  access_token,
  catgs_render,
  start_server,
  type RunningServer,
  with_tokens,
} from './support/programs';
import { tone } from './support/media_files';
import { painted_jpeg } from './support/painted';
import { scratch_folder, write_tours } from './support/scenes';

const folder = scratch_folder();
const scene = path.join(folder, 'hall.ply');
const counted = ['--min-fps', '0']; // slots are counted, whatever this machine can do

let guarded: RunningServer; // visitors need tokens, and its scene has a tour

beforeAll(async () => {
  catgs_render('synth', 'city', scene, '--gaussians', '30000');
  const [toured, media] = [path.join(folder, 'toured.ply'), path.join(folder, 'toured.media')];
  copyFileSync(scene, toured);
  copyFileSync(path.join(folder, 'hall.json'), path.join(folder, 'toured.json'));
  write_tours(path.join(folder, 'toured.json'), ({ focus, start_pose: { position } }) => {
    const towards = (share: number): number[] =>
      position.map((v, i) => v + (focus[i]! - v) * share);
    const stop = {
      title: 'The hall',
      caption: 'Built in 1904.',
      translations: {
        de: { title: 'Die Halle', caption: '1904 erbaut.' },
        fr: { caption: 'Bâti en 1904.' },
      },
      position: towards(0.2),
      look_at: focus,
      marker: towards(0.5),
      media: [{ src: 'door.jpg', alt: 'A door', translations: { de: { alt: 'Eine Tür' } } }],
      narration: { src: 'en.wav', translations: { de: { src: 'de.wav' } } },
    };
    const gate = { title: 'The gate', position: towards(0.3), look_at: focus };
    return [{ title: 'A walk', stops: [stop, gate] }];
  });
  mkdirSync(media);
  writeFileSync(path.join(media, 'door.jpg'), Buffer.from(await painted_jpeg()));
  for (const name of ['en.wav', 'de.wav']) writeFileSync(path.join(media, name), tone(5));
  guarded = await start_server(toured, [...counted, ...with_tokens]);
});

async function move(page: Page): Promise<void> {
  await page.keyboard.press('Escape');
  await page.locator('#view').focus();
  for (let i = 0; i < 4; ++i) await page.keyboard.press('ArrowLeft');
  await settle(page);
}

const apart = async (a: Page, b: Page): Promise<number> =>
  distance(await pose_of(a), await pose_of(b));

describe('a presentation', () => {
  it('is followed on streams of their own by participants, who may leave and come back', async () => {
    const server = await start_server(scene, counted);
    const { page: host, errors } = await open(server.url, windows.desktop);
    const link = await present(host);
    await keep_screenshot(host, 'together-present');
    expect(await barriers(host)).toEqual([]);
    const { page: participant, errors: more } = await open(link, windows.phone);
    await participant.getByText('Ada is presenting').waitFor();
    await host.getByText('You are presenting to one participant.').waitFor();
    await move(host);
    await expect.poll(() => apart(host, participant)).toBeLessThan(1e-3);
    await keep_screenshot(participant, 'together-follow');
    expect(await barriers(participant)).toEqual([]);

    // A gesture leaves, and one tap comes back.
    await participant.locator('#view').focus();
    await participant.keyboard.press('ArrowUp');
    const again = participant.getByRole('button', { name: 'Follow Ada' });
    await again.waitFor();
    await host.getByText('You are presenting. Nobody has joined yet.').waitFor();
    await move(host);
    expect(await apart(host, participant)).toBeGreaterThan(0.01);
    await keep_screenshot(participant, 'together-left');
    await again.tap();
    await expect.poll(() => apart(host, participant)).toBeLessThan(1e-3);

    await host.getByRole('button', { name: 'Stop' }).first().click();
    await participant.getByText('The presentation has ended').waitFor();
    expect([...errors, ...more]).toEqual([]);
  });

  it('shows all what somebody points at', async () => {
    const server = await start_server(scene, counted);
    const { page: host } = await open(server.url, windows.desktop);
    const link = await present(host);
    await host.keyboard.press('Escape');
    const { page: participant, errors } = await open(link, windows.phone);
    await participant.getByText('Ada is presenting').waitFor();
    const rings = (page: Page): Promise<number> => page.locator('.ping').count();
    // By Alt and a click.
    await host.locator('#view').click({ position: { x: 640, y: 500 }, modifiers: ['Alt'] });
    await participant.getByText('Ada points at something').waitFor({ state: 'attached' });
    await expect.poll(() => rings(host)).toBe(1);
    expect(await rings(participant)).toBe(1);
    await keep_screenshot(host, 'together-ping');
    await keep_screenshot(participant, 'together-ping-phone');
    expect(await barriers(host)).toEqual([]);
    // By a long press; a participant may not.
    await expect.poll(() => rings(host)).toBe(0);
    await host.mouse.move(600, 480);
    await host.mouse.down();
    await expect.poll(() => rings(participant)).toBe(1);
    await host.mouse.up();
    expect(await participant.locator('#shared-tour-point').isHidden()).toBe(true);
    // The host lets participants point, and hears where all are.
    await host.getByRole('button', { name: 'Share' }).click();
    await host.getByLabel('Participants may point at things').check();
    await host.getByLabel('Participants see where everybody is').check();
    await keep_screenshot(host, 'together-allowed');
    const point = participant.getByRole('button', { name: 'Point at the middle' });
    await point.waitFor();
    await expect.poll(() => rings(host)).toBe(0);
    await point.tap();
    await host.getByText('Somebody points at something').waitFor({ state: 'attached' });
    await keep_screenshot(participant, 'together-may-point');
    expect(await barriers(participant)).toEqual([]);
    expect(errors).toEqual([]);
  });

  it('is watched where no slot is free, and left for a visit from where the host stood', async () => {
    const server = await start_server(scene, [...counted, '--max-sessions', '1']);
    const { page: host } = await open(server.url, windows.desktop);
    const link = await present(host);
    await move(host);
    const stood = await pose_of(host);
    const { page: watcher } = await new_page(windows.phone);
    await watcher.goto(link);
    await watcher.getByText('Ada is presenting').waitFor();
    await watcher.locator('#card').waitFor({ state: 'hidden' });
    await keep_screenshot(watcher, 'together-watch');
    expect(await barriers(watcher)).toEqual([]);
    expect(await watcher.getByRole('button', { name: 'Quality and view' }).isHidden()).toBe(true);
    // The ring is where the host points, though this picture has another shape.
    await host.locator('#view').click({ position: { x: 640, y: 500 }, modifiers: ['Alt'] });
    await watcher.locator('.ping').waitFor({ state: 'attached' });
    const at = await watcher.locator('.ping').evaluate((ring) => {
      const { x, y } = ring.getBoundingClientRect();
      return [x / innerWidth - 0.5, (y - innerHeight / 2) / innerWidth];
    });
    expect(at[0]).toBeCloseTo(0, 1);
    expect(at[1]).toBeCloseTo((500 - 360) / 1280, 1);
    await keep_screenshot(watcher, 'together-ping-watched');
    await watcher.keyboard.press('KeyM');
    expect(await watcher.evaluate(() => document.querySelector('#mode-label')!.textContent)).toBe(
      'Orbit',
    );
    await host.goto('about:blank'); // its slot is free
    await watcher.getByText('Nobody is presenting here now').waitFor();
    await watcher.getByRole('button', { name: 'Look around on my own' }).tap();
    await watcher.getByRole('button', { name: 'Share' }).waitFor();
    await settle(watcher);
    expect(distance(stood, await pose_of(watcher))).toBeLessThan(1e-3);
  });

  it('grants watching to those without a token, and is found by links of role spectator', async () => {
    const { page: spectator } = await new_page(windows.desktop);
    await spectator.goto(`${guarded.url}#token=${access_token('spectator')}`);
    await spectator.getByRole('heading', { name: 'Nobody is presenting here now' }).waitFor();
    await keep_screenshot(spectator, 'together-nobody');
    const { page: host } = await open(
      `${guarded.url}#token=${access_token('viewer')}`,
      windows.desktop,
    );
    const link = await present(host);
    expect(link).not.toContain('token=');
    await spectator.getByText('Ada is presenting').waitFor();
    const { page: guest } = await new_page(windows.desktop);
    await guest.goto(link);
    await guest.getByText('Ada is presenting to 2 participants').waitFor();
    await guest.locator('#card').waitFor({ state: 'hidden' });
    await keep_screenshot(guest, 'together-guest');
    expect(await guest.locator('#shared-tour-action').isHidden()).toBe(true);
    await host.locator('#present-stop').click();
    for (const page of [spectator, guest])
      await page.getByRole('heading', { name: 'Nobody is presenting here now' }).waitFor();
    await host.getByRole('button', { name: 'Present', exact: true }).click();
    for (const page of [spectator, guest]) await page.getByText('Ada is presenting').waitFor();
  });

  it('shows participants the stop that its host shows, each in their own language', async () => {
    const viewer = `token=${access_token('viewer')}`;
    const { page: host } = await open(`${guarded.url}#${viewer}`, windows.desktop);
    const link = await present(host);
    await host.keyboard.press('Escape');
    const { page: follower, errors } = await open(`${link}&${viewer}`, {
      ...windows.phone,
      locale: 'de-DE',
    });
    const { page: guest, errors: more } = await new_page({ ...windows.desktop, locale: 'fr-FR' });
    await guest.goto(link); // without a token
    await host.getByText('You are presenting to 2 participants.').waitFor();
    await host.locator('#tour-next').click();
    await follower.locator('#tour-text', { hasText: '1904 erbaut.' }).waitFor();
    await follower.getByRole('heading', { name: 'Die Halle' }).waitFor();
    await guest.locator('#tour-text', { hasText: 'Bâti en 1904.' }).waitFor();
    await settle(host);
    for (const [page, alt, voice] of [
      [host, 'A door', 'en.wav'],
      [follower, 'Eine Tür', 'de.wav'],
      [guest, 'A door', 'en.wav'],
    ] as const) {
      await page.locator('.hotspot[aria-current]').waitFor();
      const picture = page.getByAltText(alt);
      await expect
        .poll(() => picture.evaluate((img: HTMLImageElement) => img.naturalWidth))
        .toBeGreaterThan(0);
      const heard = page.locator('#tour > audio');
      await expect.poll(() => heard.evaluate((el: HTMLAudioElement) => el.src)).toContain(voice);
    }
    expect(await apart(host, follower)).toBeLessThan(1e-3);
    await keep_screenshot(follower, 'together-stop-phone');
    await keep_screenshot(guest, 'together-stop-guest');
    expect([...(await barriers(follower)), ...(await barriers(guest))]).toEqual([]);
    // A spectator leads nobody, and sees the hotspot where it is in the host's picture.
    await guest.keyboard.press('PageDown');
    expect(await guest.locator('#tour-next').isHidden()).toBe(true);
    // Without a stop at the host's, there is none at theirs.
    await host.keyboard.press('KeyR');
    await follower.getByRole('heading', { name: 'A walk' }).waitFor();
    await guest.locator('#tour').waitFor({ state: 'hidden' });
    // On its own, a follower stays at the stop and has the tour for itself.
    await host.locator('#tour-next').click();
    await follower.getByRole('heading', { name: 'Die Halle' }).waitFor();
    await follower.locator('#view').focus();
    await follower.keyboard.press('ArrowUp');
    await host.keyboard.press('KeyR');
    await host.getByText('You are presenting to one participant.').waitFor();
    expect(await follower.locator('#tour-title').innerText()).toBe('Die Halle');
    // Without a token there is no poster before the welcome.
    expect([...errors, ...more.filter((error) => !error.includes('401'))]).toEqual([]);
  });
});
