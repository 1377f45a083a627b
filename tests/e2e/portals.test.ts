// Portals: from scene to scene and back, against the real server.
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
import { scratch_folder, write_tours } from './support/scenes';

const folder = scratch_folder();
const file = (name: string): string => path.join(folder, name);
const arrival = { position: [0.5, -1.5, -6], look_at: [0, 0, 0], fov_deg: 50 };

let server: RunningServer;

beforeAll(async () => {
  catgs_render('synth', 'city', file('town.ply'), '--gaussians', '30000');
  catgs_render('synth', 'garden', file('park.ply'), '--gaussians', '30000');
  const stop =
    (title: string, share: number, more: object) =>
    (sidecar: { start_pose: { position: readonly number[] }; focus: readonly number[] }) => {
      const at = (s: number): number[] =>
        sidecar.start_pose.position.map((v, i) => v + (sidecar.focus[i]! - v) * s);
      return {
        title,
        fov_deg: 60,
        stay_s: 0.5,
        position: at(share),
        look_at: sidecar.focus,
        marker: at(share + 0.4),
        ...more,
      };
    };
  write_tours(file('town.json'), (sidecar) => [
    {
      title: 'Through the town',
      stops: [
        stop('The gate', 0.1, {
          caption: 'Behind it is the park.',
          portal: { scene: 'park', ...arrival },
        })(sidecar),
        stop('The wall', 0.3, { portal: { scene: 'castle' } })(sidecar),
        stop('The stairs', 0.2, { portal: { scene: 'park', tour: 1, stop: 2 } })(sidecar),
      ],
    },
  ]);
  write_tours(file('park.json'), (sidecar) => [
    {
      title: 'Through the park',
      stops: [stop('Pond', 0.1, {})(sidecar), stop('Oak', 0.5, {})(sidecar)],
    },
  ]);
  server = await start_server(file('town.ply'), [
    ...['--scene-folder', folder, '--min-fps', '0'],
    ...with_tokens,
  ]);
});

const scene_of = (page: Page): Promise<string> => page.locator('#scene-name bdi').innerText();
const token = (role = 'viewer'): string => `#token=${access_token(role)}`;

async function go_to_stop(page: Page, n: number): Promise<void> {
  for (let i = 0; i < n; ++i) await page.getByRole('button', { name: 'Next stop' }).click();
  await page.getByText(`${n} of 3`).waitFor();
  await settle(page);
}

describe('a portal', () => {
  it('leads to a view of another scene, and the history back to where the visitor was', async () => {
    const { page, errors } = await open(`${server.url}?scene=town${token()}`, windows.desktop);
    await page.getByRole('button', { name: 'To park' }).first().waitFor();
    await go_to_stop(page, 1);
    const left = await pose_of(page);
    await keep_screenshot(page, 'portal-stop');
    expect(await barriers(page)).toEqual([]);
    await page.locator('#tour').getByRole('button', { name: 'To park' }).click();
    // The old picture stays until there is another from where the visitor arrives.
    await page.locator('.cover').waitFor();
    await page.locator('.cover').waitFor({ state: 'detached' });
    await settle(page);
    expect(await scene_of(page)).toBe('park');
    const there = await pose_of(page);
    there.position.forEach((v, i) => expect(v).toBeCloseTo(arrival.position[i]!, 4));
    expect(page.url()).toContain('scene=park');
    expect(page.url()).not.toContain('token=');
    await keep_screenshot(page, 'portal-arrived');
    await page.goBack();
    await expect.poll(() => scene_of(page)).toBe('town');
    await settle(page);
    await expect.poll(async () => distance(left, await pose_of(page))).toBeLessThan(1e-3);
    await page.goForward();
    await expect.poll(() => scene_of(page)).toBe('park');
    await expect.poll(async () => distance(there, await pose_of(page))).toBeLessThan(1e-3);
    await page.locator('.cover').waitFor({ state: 'detached' });
    expect(errors).toEqual([]);
  });

  it('takes participants along who follow a host, or watch', async () => {
    const { page: host, errors } = await open(
      `${server.url}?scene=town${token()}`,
      windows.desktop,
    );
    await go_to_stop(host, 1);
    const link = await present(host);
    await host.keyboard.press('Escape');
    const { page: participant, errors: more } = await open(
      `${link}&${token().slice(1)}`,
      windows.phone,
    );
    const { page: guest } = await new_page(windows.phone);
    await guest.goto(link); // without a token of their own
    for (const page of [participant, guest])
      await page.getByText('Ada is presenting to 2 participants').waitFor();
    await host.locator('#tour-portal').click();
    await participant.getByText('Ada has moved to another scene. You follow.').waitFor();
    for (const page of [participant, guest]) await expect.poll(() => scene_of(page)).toBe('park');
    await guest.locator('#card').waitFor({ state: 'hidden' });
    expect(participant.url()).toMatch(/scene=park.*#watch=/);
    for (const page of [host, participant, guest])
      await page.locator('#shared-tour', { hasText: /presenting to 2 participants/ }).waitFor();
    await expect
      .poll(async () => distance(await pose_of(host), await pose_of(participant)))
      .toBeLessThan(1e-3);
    await settle(participant);
    await keep_screenshot(participant, 'portal-followed');
    expect([errors, more, await barriers(participant)]).toEqual([[], [], []]);
  });

  it('lets go of whoever leaves a guide by the history, or after the end', async () => {
    const { page: host } = await open(`${server.url}?scene=town${token()}`, windows.desktop);
    await go_to_stop(host, 1);
    const link = await present(host);
    await host.keyboard.press('Escape');
    const { page: participant } = await open(`${link}&${token().slice(1)}`, {
      ...windows.desktop,
      reducedMotion: 'reduce',
    });
    await participant.getByText('Ada is presenting').waitFor();
    await participant.getByText('1 of 3').waitFor(); // as the host
    // Both come to the park, each by itself.
    for (const page of [participant, host]) {
      await page.locator('#tour-portal').click();
      await expect.poll(() => scene_of(page)).toBe('park');
    }
    await participant.getByRole('button', { name: 'Follow Ada' }).click();
    await participant.getByText('Ada is presenting').waitFor();
    await keep_screenshot(participant, 'portal-before-back');
    const stays_in = async (scene: string): Promise<void> => {
      await expect.poll(() => scene_of(participant)).toBe(scene);
      await settle(participant);
      expect(await scene_of(participant)).toBe(scene);
      expect(await participant.getByText('Ada has moved to another scene').count()).toBe(0);
    };
    await participant.goBack();
    await participant.getByRole('button', { name: 'Follow Ada' }).waitFor();
    await stays_in('town');
    await keep_screenshot(participant, 'portal-left-by-history');

    await host.goBack();
    await expect.poll(() => scene_of(host)).toBe('town');
    await participant.getByRole('button', { name: 'Follow Ada' }).click();
    await participant.getByText('Ada is presenting').waitFor();
    await host.locator('#shared-tour-action').click();
    await participant.getByText('The presentation has ended').waitFor();
    await present(host);
    await host.keyboard.press('Escape');
    await participant.goForward();
    await stays_in('park');
  });

  it('leads to a stop of another tour, and is passed by a playing one', async () => {
    const { page } = await open(`${server.url}?scene=town${token()}`, {
      ...windows.phone,
      reducedMotion: 'reduce',
    });
    await page.getByRole('button', { name: 'Play the tour' }).tap();
    await page.getByText('3 of 3').waitFor();
    await page.getByText('1 of 3').waitFor();
    expect(await scene_of(page)).toBe('town');
    await page.getByRole('button', { name: 'Pause the tour' }).tap();
    const position = page.locator('#tour-position');
    while ((await position.innerText()) !== '3 of 3')
      await page.getByRole('button', { name: 'Next stop' }).tap();
    await keep_screenshot(page, 'portal-phone');
    expect(await barriers(page)).toEqual([]);
    await page.locator('#tour').getByRole('button', { name: 'To park' }).tap();
    await page.getByText('2 of 2').waitFor();
    expect(await page.locator('#tour-title').innerText()).toBe('Oak');
  });

  it('says that it is closed where there is no such scene, or the link does not open it', async () => {
    const { page, errors } = await open(`${server.url}?scene=town${token()}`, windows.desktop);
    await go_to_stop(page, 2);
    await page.getByText('You cannot enter castle.').waitFor();
    expect(await page.locator('#tour-portal').isDisabled()).toBe(true);
    await keep_screenshot(page, 'portal-closed');
    expect(await barriers(page)).toEqual([]);
    expect(errors).toEqual([]);
  });

  it.each(['de', 'ar'])('looks right in %s', async (language) => {
    const { page } = await open(
      `${server.url}?scene=town&lang=${language}${token()}`,
      windows.phone,
    );
    await page.locator('#tour-next').tap();
    await page.locator('#tour-portal').waitFor();
    await settle(page);
    await keep_screenshot(page, `portal-${language}`);
    expect(await barriers(page)).toEqual([]);
  });

  it('is made by an author from the list of scenes', async () => {
    const { page } = await open(
      `${server.url}?scene=town&author${token('author')}`,
      windows.desktop,
    );
    const leads_to = page.getByLabel('Scene that stop 1 leads to');
    await leads_to.waitFor();
    expect(await leads_to.inputValue()).toBe('park');
    await page.getByLabel('Title of stop 2').focus();
    const second = page.getByLabel('Scene that stop 2 leads to');
    expect(await second.locator('option').allInnerTexts()).toEqual([
      'no other scene',
      'castle',
      'park',
    ]);
    await second.selectOption('park');
    await keep_screenshot(page, 'portal-author');
    expect(await barriers(page)).toEqual([]);
    await page.getByRole('button', { name: 'Save to the server' }).click();
    await page.getByText('Saved. Visitors see it').waitFor();
    await page.getByRole('button', { name: 'Show', exact: true }).click();
    await page
      .locator('#tour')
      .getByRole('button', { name: 'To park' })
      .waitFor({ state: 'attached' });
  });
});
