// The page in Firefox, against the real server.
import { writeFileSync } from 'node:fs';
import path from 'node:path';
import { describe, expect, it } from 'vitest';
import type { Pose } from '#client/camera/eye';
import { distance } from './support/camera';
import { open_in_firefox } from './support/firefox';
import { catgs_render, start_server } from './support/programs';
import { scratch_folder } from './support/scenes';

describe('Firefox', () => {
  it('shows video, turns and plays a tour', async () => {
    const folder = scratch_folder();
    const scene = path.join(folder, 'hall.ply');
    catgs_render('synth', 'city', scene, '--gaussians', '50000');
    const stop = (x: number): object => ({ title: `Stop ${x}`, position: [x, -3, 0], look_at: [0, -2, 20], fly_s: 1, stay_s: 1 });
    const stops = [stop(2), stop(4)];
    writeFileSync(path.join(folder, 'hall.json'), JSON.stringify({ title: 'The hall', tours: [{ title: 'A tour', stops }] }));
    const server = await start_server(scene, ['--min-fps', '0']);
    const page = await open_in_firefox(server.url, 960, 600);
    const pose = (): Promise<Pose> => page.evaluate('window.catgs.pose()');
    const settle = (): Promise<void> => page.evaluate('window.catgs.settled()');
    await page.until('window.catgs');
    await settle();
    const start = await pose();
    expect(await page.evaluate('document.title')).toBe('The hall – CaT-GS');
    await page.keep_screenshot('firefox');

    await page.drag([480, 300], [120, 40]);
    await settle();
    const turned = await pose();
    expect(Math.hypot(...turned.orientation.map((v, i) => v - start.orientation[i]!))).toBeGreaterThan(0.05);

    await page.click('#tour-play');
    await page.until(`document.getElementById('tour-place').textContent === '1 of 2'`);
    await page.until(`document.getElementById('tour-place').textContent === '2 of 2'`);
    await page.press('\uE00C'); // Escape
    await page.click('#tour-play');
    await settle();
    await page.keep_screenshot('firefox-tour');
    expect(distance(await pose(), start)).toBeGreaterThan(0.5);

    await page.press('i');
    await page.until(`document.querySelector('#stats-panel dl')`);
    expect(await page.evaluate<string>(`document.getElementById('stats-panel').innerText`)).toMatch(/x264|H\.264/);
    await page.keep_screenshot('firefox-statistics');
    expect(page.errors).toEqual([]);
  });
});
