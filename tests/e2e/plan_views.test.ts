// Plan, elevations and the section box, against the real server.
import path from 'node:path';
import type { Page } from 'playwright-core';
import { beforeAll, describe, expect, it } from 'vitest';
import { look_at } from '#client/base/vector';
import { barriers } from './support/axe';
import { choose_full_size, keep_screenshot, open, windows } from './support/browser';
import { distance, pose_of, settle } from './support/camera';
import { psnr_db, read_png, settled_picture, type Picture } from './support/pictures';
import { catgs_render, start_server, type RunningServer } from './support/programs';
import { make_streets, scratch_folder, write_tum } from './support/scenes';

const folder = scratch_folder();
const views = '#views-panel';
const at_stop = [4, -3, 6, 16, 14, 9, 30];

let scene: string;
let server: RunningServer;

beforeAll(async () => {
  const corner = { title: 'The corner', position: [4, -4, -30], orientation: [0, 0, 0, 1] };
  scene = make_streets(folder, 'Survey', [
    { ...corner, view_height: 18, section: at_stop },
    { title: 'The street', position: [0, -1.6, -8], look_at: [0, -1.6, 60] },
  ]);
  server = await start_server(scene, ['--min-fps', '0']);
});

async function choose(page: Page, name: string): Promise<void> {
  await page.locator(views).getByRole('button', { name, exact: true }).click();
  await settle(page);
}

async function open_views(page: Page): Promise<void> {
  await page.locator('#button-views').click();
  await page.locator(`${views} fieldset`).first().waitFor();
}

const view_height = (page: Page): Promise<number | undefined> =>
  page.evaluate(async () => (await window.catgs!.snapshot()).view.view_height);

/** What catgs-render draws of the view that the page shows. */
async function rendered(page: Page, section: readonly number[]): Promise<Picture> {
  const { header, width_px, height_px } = await page.evaluate(async () => {
    const { header: of, ...picture } = await window.catgs!.snapshot();
    return { ...picture, header: { pose: of.renderPose!, height: of.viewHeight }, rgba: 0 };
  });
  const { position: p, orientation: q } = header.pose;
  const trace = path.join(folder, 'pose.tum');
  const out = path.join(folder, 'view.png');
  write_tum(trace, [{ position: [p!.x, p!.y, p!.z], orientation: [q!.x, q!.y, q!.z, q!.w] }]);
  catgs_render(
    ...['frames', scene, '--trace', trace, '--out', out, '--size', `${width_px}x${height_px}`],
    ...[`--orthographic=${header.height}`, `--section=${section.join(',')}`, '--renderer', 'cpu'],
  );
  return read_png(page, out);
}

const linked_section = async (page: Page): Promise<number[]> => {
  await page.locator('#button-share').click();
  const link = new URL(await page.locator('#share-link').inputValue());
  return new URLSearchParams(link.hash.slice(1)).get('section')!.split(',').map(Number);
};

describe('plan and elevations', () => {
  it('match the images of catgs-render, with a section, and come back from a link', async () => {
    const { page, errors } = await open(server.url, { viewport: { width: 640, height: 360 } });
    await choose_full_size(page);
    await open_views(page);
    await page.getByLabel('Section box', { exact: true }).check();
    await page.getByRole('slider', { name: 'Turn' }).fill('20');
    const shown: Picture[] = [];
    for (const name of ['Plan', 'Front', 'Right', 'Back', 'Left']) {
      await choose(page, name);
      shown.push(await settled_picture(page));
      const button = page.locator(views).getByRole('button', { name, exact: true });
      expect(await button.getAttribute('aria-pressed')).toBe('true');
      await keep_screenshot(page, `views-${name.toLowerCase()}`);
    }
    const [bar, panel, title] = await Promise.all(
      ['#scale-bar', views, '#scene-title'].map((id) => page.locator(id).boundingBox()),
    );
    expect(bar!.x + bar!.width, 'beside the panel').toBeLessThan(panel!.x);
    expect(bar!.y, 'under the title').toBeGreaterThan(title!.y + title!.height);
    const section = await linked_section(page);
    expect(section[6]).toBeCloseTo(20, 3);
    const psnr = psnr_db(await rendered(page, section), shown[4]!);
    console.log(`elevation: ${psnr.toFixed(2)} dB`);
    expect(psnr).toBeGreaterThanOrEqual(36);
    for (const other of shown.slice(0, 4)) expect(psnr_db(other, shown[4]!)).toBeLessThan(30);
    const link = await page.locator('#share-link').inputValue();
    await page.goto('about:blank');
    await page.goto(link);
    await settle(page);
    await page.locator('#scale-bar').waitFor();
    await choose_full_size(page);
    expect(psnr_db(await settled_picture(page), shown[4]!)).toBeGreaterThan(34);
    expect(errors).toEqual([]);
  });

  it('pan by drags, zoom by wheel and keys, and lead back', async () => {
    const { page } = await open(server.url, windows.desktop);
    const before = await pose_of(page);
    await open_views(page);
    await choose(page, 'Plan');
    const plan = await pose_of(page);
    const height = (await view_height(page))!;
    const bar = page.locator('#scale-bar');
    expect(await bar.innerText()).toMatch(/^\d+\sft$/);
    const metres = parseInt(await bar.innerText(), 10) * 0.3048;
    expect(((await bar.boundingBox())!.width * height) / 720 / metres).toBeCloseTo(1, 1);
    await page.mouse.move(500, 300);
    await page.mouse.down();
    await page.mouse.move(572, 300, { steps: 4 });
    await page.waitForTimeout(300); // no glide
    await page.mouse.up();
    await settle(page);
    const panned = await pose_of(page);
    const way = Math.hypot(...panned.position.map((v, i) => v - plan.position[i]!));
    expect(way / height).toBeCloseTo(0.1, 2);
    expect(panned.orientation).toEqual(plan.orientation);
    await page.mouse.wheel(0, -200);
    await page.locator('#view').focus();
    await page.keyboard.press('KeyQ');
    await settle(page);
    expect(await view_height(page)).toBeLessThan(height);
    await choose(page, 'Perspective');
    expect(distance(await pose_of(page), before)).toBe(0);
    expect(await bar.isHidden()).toBe(true);
    await choose(page, 'Front');
    await page.keyboard.press('KeyM'); // another mode leaves it, too
    await settle(page);
    expect(await view_height(page)).toBeUndefined();
  });

  it('are part of a tour', async () => {
    const { page, errors } = await open(server.url, windows.desktop);
    await page.locator('#tour-next').click();
    await page.locator('#scale-bar').waitFor();
    await settle(page);
    expect(await view_height(page)).toBe(18);
    expect(psnr_db(await rendered(page, at_stop), await settled_picture(page))).toBeGreaterThan(36);
    expect(await page.locator('.section-handle:visible').count()).toBe(0); // the visitor asked for none
    await keep_screenshot(page, 'views-stop');
    await page.locator('#tour-next').click();
    await settle(page);
    expect(await view_height(page)).toBeUndefined();
    await page.locator('#button-share').click();
    expect(await page.locator('#share-link').inputValue()).not.toContain('section');
    await open_views(page);
    const play = page.locator('#tour-play');
    for (const take_over of ['Plan', 'Section box', 'Turn'] as const) {
      await play.click();
      await expect.poll(() => play.getAttribute('aria-label')).toMatch(/^Pause/);
      if (take_over === 'Plan') await choose(page, take_over);
      else if (take_over === 'Turn') await page.getByRole('slider', { name: 'Turn' }).fill('20');
      else await page.getByLabel('Section box', { exact: true }).check();
      await expect.poll(() => play.getAttribute('aria-label')).toMatch(/^Play/);
    }
    await page.getByRole('button', { name: /Reset the box/ }).click();
    expect(await page.getByRole('slider', { name: 'Turn' }).inputValue()).toBe('0');
    expect(errors).toEqual([]);
  });
});

describe('the section box', () => {
  it.each(['desktop', 'phone'] as const)('is dragged by its sides, on a %s', async (name) => {
    const { page, errors } = await open(server.url, windows[name]);
    await open_views(page);
    await page.getByLabel('Section box', { exact: true }).check();
    await choose(page, 'Plan');
    await keep_screenshot(page, `section-${name}-whole`);
    expect(await barriers(page)).toEqual([]);
    const whole = await settled_picture(page);
    if (name === 'phone') await page.locator('#button-views').click(); // it covers the picture
    const handle = page.getByRole('slider', { name: 'Section box: Right' });
    const width = async (): Promise<number> => Number(await handle.getAttribute('aria-valuenow'));
    const before = await width();
    const at = (await handle.boundingBox())!;
    const middle = [at.x + at.width / 2, at.y + at.height / 2] as const;
    await page.mouse.move(...middle);
    await page.mouse.down();
    await page.mouse.move(middle[0] - 60, middle[1], { steps: 5 });
    await page.mouse.up();
    await settle(page);
    const after = (await handle.boundingBox())!;
    expect(after.x).toBeCloseTo(at.x - 60, -1);
    expect(await width()).toBeLessThan(before);
    expect(psnr_db(await settled_picture(page), whole)).toBeLessThan(35);
    const dragged = await width();
    await handle.focus();
    await page.keyboard.press('ArrowLeft');
    expect(await width()).toBeLessThan(dragged);
    await expect.poll(() => handle.getAttribute('aria-valuetext')).toMatch(/ft$/);
    // A perspective view has the box, too.
    const from = [-30, -25, -40] as const;
    const view = [...from, ...look_at(from, [0, -4, 3], [0, -1, 0]), 60].join(',');
    const hash = `at=${view}&section=0,-4,3,30,24,9,15`;
    await page.evaluate((link) => (location.hash = link), hash);
    await settle(page);
    await keep_screenshot(page, `section-${name}-perspective`);
    expect(await barriers(page)).toEqual([]);
    expect(await page.getByRole('slider', { name: /^Section box/ }).count()).toBeGreaterThan(3);
    expect(errors).toEqual([]);
  });
});
