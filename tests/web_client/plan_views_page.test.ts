// Orthographic views among the parts of the page that lead the camera.
import { readFileSync } from 'node:fs';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { browser_timers } from '#client/base/clock';
import { identity, type Vec3 } from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import type { Walker } from '#client/camera/walker';
import type { ScrollGate } from '#client/input/scroll_gate';
import { Navigation } from '#client/page/navigation';
import { EmbedApi } from '#client/ui/embed';
import { shows_camera } from '#client/ui/automation';
import { eyes_of } from '#client/walk/walk_map';
import { Walking } from '#client/walkable_area/walking';
import type { WorkerClient } from '#client/worker/client';
import { expect_vec, scene } from './cameras';
import { FakeTime } from './fakes';
import { map } from './walk_maps';

const plan: Eye = { position: [1, -9, 3], orientation: identity, fov_y_rad: 1, view_height: 8 };

/** An element of a page without one. */
const element = (): object =>
  Object.assign(new EventTarget(), {
    append: () => undefined,
    setAttribute: () => undefined,
    remove: () => undefined,
    classList: { toggle: () => false },
  });

beforeEach(() => {
  vi.stubGlobal('window', new EventTarget());
  vi.stubGlobal(
    'document',
    Object.assign(new EventTarget(), { createElementNS: element, hidden: false }),
  );
  vi.stubGlobal('navigator', { getGamepads: () => [] });
  vi.stubGlobal('requestAnimationFrame', () => 0);
});
afterEach(() => vi.unstubAllGlobals());

function make_navigation(start: Vec3 = scene.start_pose.position) {
  const view = element() as HTMLElement;
  const worker = { post: () => undefined, on: () => undefined } as unknown as WorkerClient;
  const time = new FakeTime();
  const navigation = new Navigation(view, worker, time, true, {} as ScrollGate);
  const start_pose = { ...scene.start_pose, position: start };
  navigation.camera.load({ ...scene, up: map.axes[2], start_pose });
  const taken = vi.fn();
  navigation.taken_over.listen(taken);
  return { navigation, view, time, taken };
}

function make_walking(start: Vec3) {
  const made = make_navigation(start);
  const parts = { ...made, clock: made.time, timers: browser_timers };
  const walking = new Walking({ ...parts, announce: () => undefined, reduced_motion: true }, map);
  return { ...made, walking };
}

describe('an orthographic view', () => {
  it('is left by the visitor alone, who takes over', () => {
    const { navigation, taken } = make_navigation();
    navigation.leave_orthographic();
    expect(taken).not.toHaveBeenCalled();
    navigation.put(plan);
    navigation.leave_orthographic();
    expect(taken).toHaveBeenCalledOnce();
    expect(navigation.eye.view_height).toBeUndefined();
  });

  it('stays when the walkable area becomes known', () => {
    const walker = { stand_near: () => true } as unknown as Walker;
    for (const [is_plan, mode] of [
      [true, 'fly'],
      [false, 'walk'],
    ] as const) {
      const { navigation } = make_navigation();
      navigation.camera.set_mode('fly');
      if (is_plan) navigation.put(plan);
      vi.spyOn(navigation, 'looks_by_default', 'get').mockReturnValue(true);
      navigation.set_walker(walker);
      expect([navigation.camera.is_orthographic, navigation.camera.mode]).toEqual([is_plan, mode]);
    }
  });

  it('keeps a walker who has chosen it from coming down', async () => {
    const start = eyes_of(map, map.start);
    const { navigation, walking } = make_walking([start[0], start[1], start[2] + 0.5]);
    navigation.camera.walker = walking.walker;
    navigation.camera.set_mode('walk');
    navigation.camera.stop_flight();
    navigation.put({ ...plan, position: [start[0], start[1], start[2] + 0.5] });
    const stand = vi.spyOn(navigation, 'stand');
    expect(await walking.come_down()).toBe(true);
    expect(stand).not.toHaveBeenCalled();
  });

  it('ends by a click on the floor plan, which leads there in perspective', async () => {
    const start = eyes_of(map, map.start);
    const { navigation, walking } = make_walking([start[0], start[1], start[2] + 9]);
    const { orientation } = navigation.eye;
    navigation.put({ ...plan, orientation: [0, 1, 0, 0] });
    await walking.go_to(map.start);
    navigation.camera.step(1);
    expect(navigation.eye.view_height).toBeUndefined();
    expect_vec(navigation.eye.position, start);
    expect(navigation.eye.orientation).toEqual(orientation);
  });

  it('is told to the page around the frame, and put by it', () => {
    const said: unknown[] = [];
    const around = { postMessage: (news: unknown) => said.push(news) };
    const frame = Object.assign(new EventTarget(), { parent: around });
    const put = vi.fn();
    new EmbedApi({ navigation: { eye: plan }, put } as never, frame as never);
    const say = (data: object): boolean =>
      frame.dispatchEvent(
        Object.assign(new Event('message'), { data, source: around, origin: 'https://host' }),
      );
    say({ catgs: 'get_pose' });
    expect(said).toMatchObject([{ catgs: 'pose', view_height: 8 }]);
    say(said[0] as object);
    expect(put).toHaveBeenCalledWith(plan);
  });

  it('is shown when its picture is as high, whatever the scale', () => {
    const shown = (height: number, by: number): boolean => {
      const eye = { ...plan, view_height: height };
      const picture = { eye: { ...eye, view_height: height * by }, pose_id: 1 };
      return shows_camera(picture as never, { eye, scene }, 2);
    };
    for (const height of [1e-4, 1, 1e6])
      expect([shown(height, 1 + 1e-6), shown(height, 1.01)]).toEqual([true, false]);
  });
});

it('a page that watches has no button that moves the camera', () => {
  const read = (file: string): string =>
    readFileSync(new URL(`../../web_client/${file}`, import.meta.url), 'utf8');
  const [, hidden = ''] =
    /body\.watching :is\((#tour-controls[^)]*)\)/.exec(read('src/ui/tour.css')) ?? [];
  const buttons = [...read('index.html').matchAll(/id="(button-\w+)"/g)].map(([, id]) => `#${id}`);
  const left = buttons.filter((id) => !hidden.split(', ').includes(id));
  expect(left).toEqual(['#button-stats', '#button-sound', '#button-full']);
});
