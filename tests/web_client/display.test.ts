import { beforeEach, describe, expect, it } from 'vitest';
import { axis_angle, identity, multiply, type Quat } from '#client/base/vector';
import { widened_fov, type Eye } from '#client/camera/eye';
import type { Picture } from '#client/decode/picture';
import { Display } from '#client/present/display';
import type { Depths, Placing, Presenter } from '#client/present/presenter';
import { warped } from '#client/present/warp';
import { FrameHeaderSchema, type FrameHeader } from '#client/wire/wire';
import { create } from '@bufbuild/protobuf';
import { frame_sizes } from '#client/worker/frame_sizes';
import golden from '../support/warp_golden.json';

const at = (yaw: number): Eye => {
  const orientation: Quat = yaw === 0 ? identity : axis_angle([0, -1, 0], yaw);
  return { position: [0, 0, 0], orientation, fov_y_rad: 1 };
};

const header = (widthPx: number, heightPx: number, depthColumns = 0): FrameHeader =>
  create(FrameHeaderSchema, { widthPx, heightPx, depthColumns });

let drawn: (Placing | undefined)[];
let redrawn: Placing[];
let refresh: (() => void)[];
let display: Display;
let now_us = 0;

const presenter = (can_warp: boolean): Presenter => ({
  kind: 'webgl2',
  can_warp,
  most_px: Infinity,
  draw: (_picture, placing) => {
    drawn.push(placing);
    return Promise.resolve();
  },
  redraw: (placing) => void redrawn.push(placing),
  read: () => ({ width_px: 640, height_px: 360, rgba: new Uint8ClampedArray(4) }),
});

function make(can_warp: boolean): Display {
  const environment = {
    now_us: () => now_us,
    on_refresh: (draw: () => void) => void refresh.push(draw),
    overscan_changed: () => undefined,
  };
  return new Display(presenter(can_warp), environment, { width_px: 1600, height_px: 900 });
}

function look(yaw: number): void {
  display.camera = { pose_id: 1, time_us: 0, eye: at(yaw), distance: Infinity };
}

function next_refresh(): void {
  for (const draw of refresh.splice(0)) draw();
}

beforeEach(() => {
  [drawn, redrawn, refresh] = [[], [], []];
  display = make(true);
});

describe('the display', () => {
  const picture = {} as Picture;

  it('draws each picture as the camera of now sees it, and again when that moves', async () => {
    look(0.05);
    await display.draw(picture, at(0), header(640, 360));
    expect(warped(drawn[0]!.matrix, 0, 0)![0]).toBeLessThan(-0.01);
    expect(display.read()!.view.orientation).toEqual(at(0.05).orientation);
    look(0.02);
    look(0.01); // once per refresh is enough
    expect(refresh).toHaveLength(1);
    next_refresh();
    expect(redrawn).toHaveLength(1);
    expect(display.read()!.view.orientation).toEqual(at(0.01).orientation);
    look(0.01);
    next_refresh();
    expect(redrawn).toHaveLength(2);
  });

  it('draws a picture on its depths where it brings them', async () => {
    const depths: Depths = {
      columns: 1,
      rows: 1,
      inverse_depths: new Float32Array(1),
      distance: 2,
      nearest: 0.5,
    };
    const asked: unknown[] = [];
    const surface = { draw: () => undefined };
    const part = {
      unpack_depths: ({ depthColumns }: FrameHeader) => (depthColumns === 1 ? depths : undefined),
      depth_surface: (...given: unknown[]) => (asked.push(given), surface),
    };
    look(0.05);
    await display.draw(picture, at(0), header(640, 360, 1));
    expect(drawn.pop()!.surface).toBeUndefined(); // the part is not there yet
    expect(display.wants_depths).toBe(false);
    display.depth_part = part as unknown as typeof import('#client/present/depth_mesh');
    expect(display.wants_depths).toBe(true);
    await display.draw(picture, at(0), header(640, 360, 1));
    expect(drawn.pop()!.surface).toBe(surface);
    expect(asked).toEqual([[depths, at(0), at(0.05), 640 / 360, 16 / 9]]);
    look(0.02);
    next_refresh();
    expect(redrawn.pop()!.surface).toBe(surface);
    await display.draw(picture, at(0), header(640, 360));
    expect(drawn.pop()!.surface).toBeUndefined();
    display.mode = 'off';
    expect(display.wants_depths).toBe(false);
  });

  it('is warped for the plane of its median depth where one plane has to do', async () => {
    const depths = { distance: 2 } as Depths;
    const part = { unpack_depths: () => depths, depth_surface: () => undefined };
    display.depth_part = part as unknown as typeof import('#client/present/depth_mesh');
    const moved: Eye = { ...at(0), position: [0.1, 0, 0] };
    display.camera = { pose_id: 1, time_us: 0, eye: moved, distance: Infinity };
    await display.draw(picture, at(0), header(640, 360, 1));
    expect(warped(drawn[0]!.matrix, 0, 0)![0]).toBeGreaterThan(0.01);
  });

  it('leaves the picture as it is when the camera has jumped', async () => {
    look(0);
    await display.draw(picture, at(0), header(640, 360));
    look(1.5);
    next_refresh();
    expect(redrawn).toEqual([]);
    await display.draw(picture, at(0), header(640, 360));
    expect(drawn[1]).toBeUndefined();
    expect(display.read()!.view.orientation).toEqual(identity);
  });

  it('shows pictures larger than the view by the overscan', async () => {
    display.mode = 'on';
    look(0);
    const { x, y } = display.overscan;
    expect(x).toBeGreaterThan(y);
    const wide = { ...at(0), fov_y_rad: widened_fov(1, y) };
    await display.draw(picture, wide, header(1600 * x, 900 * y));
    expect(drawn[0]).toMatchObject({ width_px: 1600, height_px: 900 });
    const { matrix } = drawn[0]!;
    expect(warped(matrix, 1, 1)).toEqual([expect.closeTo(1 / x, 5), expect.closeTo(1 / y, 5)]);
  });

  it.each([
    [640, 360],
    [1366, 768],
    [1280, 718],
    [412, 730],
  ])('sees the pixels of pictures at rest in a view of %dx%d', async (width_px, height_px) => {
    display.size = { width_px, height_px };
    display.mode = 'on';
    look(0);
    const quality = { height_px: 0, still_height_px: 0, max_fps: 0 };
    const sizes = frame_sizes(display.size, quality, display.overscan, Infinity);
    const [wide_px, high_px] = [sizes.stillWidthPx!, sizes.stillHeightPx!];
    const eye = { ...at(0), fov_y_rad: widened_fov(1, display.overscan.y) };
    await display.draw(picture, eye, header(wide_px, high_px));
    expect(drawn[0]).toMatchObject({ width_px, height_px });
    const [x, y] = warped(drawn[0]!.matrix, 1 / width_px - 1, 1 / height_px - 1)!;
    expect((x + 1) * wide_px).toBeCloseTo(wide_px - width_px + 1, 2);
    expect((y + 1) * high_px).toBeCloseTo(high_px - height_px + 1, 2);
  });

  it('has asked for enough before a turn shows what is beside the picture', async () => {
    const rate = 1; // rad/s
    const lag_s = 0.15;
    const at_time = (s: number): Eye => at(rate * Math.max(0, s));
    for (let i = 1; i <= 60; ++i) {
      const s = i / 60;
      now_us = s * 1e6;
      display.camera = { pose_id: i, time_us: now_us, eye: at_time(s), distance: Infinity };
      const picture_eye = at_time(s - lag_s);
      const eye = { ...picture_eye, fov_y_rad: widened_fov(1, display.overscan.y) };
      await display.draw(picture, eye, header(1600 * display.overscan.x, 900 * display.overscan.y));
      // The policy looks at twelve pictures before it asks for anything.
      if (i > 20) expect(display.read()!.view.uncovered).toBeLessThanOrEqual(0.01);
    }
    expect(display.overscan.x).toBeGreaterThanOrEqual(1.26);
  });

  // tests/load/display_test.cpp holds catgs-load to the same choices.
  it('asks for the overscan of the shared turns', async () => {
    const changes = [];
    let [begin_s, refresh, before] = [0, 0, display.overscan];
    for (const turn of golden.turns) {
      const at_time = (s: number): Eye => {
        const phase = (2 * Math.PI * Math.max(0, s)) / turn.period_s;
        const yaw = axis_angle([0, -1, 0], turn.yaw_rad * Math.sin(phase));
        const pitch = axis_angle([1, 0, 0], turn.pitch_rad * Math.sin(2 * phase));
        return { ...at(0), orientation: multiply(yaw, pitch) };
      };
      for (let i = 1; i <= 60 * turn.seconds; ++i, ++refresh) {
        const s = i / 60;
        now_us = Math.round((begin_s + s) * 1e6);
        display.camera = { pose_id: i, time_us: now_us, eye: at_time(s), distance: Infinity };
        const { x, y } = display.overscan;
        const eye = { ...at_time(s - turn.lag_s), fov_y_rad: widened_fov(1, y) };
        await display.draw(picture, eye, header(1600 * x, 900 * y));
        if (display.overscan.x === before.x && display.overscan.y === before.y) continue;
        before = display.overscan;
        changes.push({ refresh, ...before });
      }
      begin_s += turn.seconds;
    }
    expect(changes).toEqual(golden.overscans);
  });

  it('does not warp where that is off, or cannot be', async () => {
    display.mode = 'off';
    look(0.05);
    await display.draw(picture, at(0), header(640, 360));
    look(0.06);
    expect([drawn, redrawn, refresh]).toEqual([[undefined], [], []]);
    display = make(false);
    look(0.05);
    await display.draw(picture, at(0), header(640, 360));
    expect(drawn).toEqual([undefined, undefined]);
    expect(display.warps).toBe(false);
  });
});
