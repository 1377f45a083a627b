// The eyes of a headset: their frusta, and the stream that the server is asked for.
import { create } from '@bufbuild/protobuf';
import { describe, expect, it } from 'vitest';
import {
  add,
  axis_angle,
  forward,
  identity,
  multiply,
  rotate,
  scale,
  sub,
  type Quat,
  type Vec3,
} from '#client/base/vector';
import type { Eye, Pose } from '#client/camera/eye';
import {
  head_of,
  picture_for,
  rate_for,
  same_stream,
  stream_for,
  units_per_metre_of,
} from '#client/headset/eyes';
import { HeadsetOverscan } from '#client/headset/overscan';
import { pose_in_room } from '#client/headset/rig';
import { placed_mesh } from '#client/present/depth_mesh';
import {
  along_axes_of,
  frustum_of,
  frustum_of_eye,
  frustum_warp,
  widened_frustum,
  type Frustum,
} from '#client/present/frustum';
import { warp_matrix, warped } from '#client/present/warp';
import { FrameHeaderSchema } from '#client/wire/generated/catgs_pb';
import { expect_vec } from './cameras';

const degrees = (angle: number): number => (angle * Math.PI) / 180;

/** As glFrustum(): left, right, bottom, top at depth 1. */
const projection = (l: number, r: number, b: number, t: number): number[] => [
  ...[2 / (r - l), 0, 0, 0],
  ...[0, 2 / (t - b), 0, 0],
  ...[(r + l) / (r - l), (t + b) / (t - b), -1.0002, -1],
  ...[0, 0, -0.2, 0],
];

const expect_frustum = (a: Frustum, b: Frustum): void => {
  for (const side of ['left', 'right', 'up', 'down'] as const)
    expect(a[side]).toBeCloseTo(b[side], 5);
};

describe('the frustum of an eye', () => {
  it('has the tangents of its projection matrix, with y down', () => {
    expect_frustum(frustum_of(projection(-1.3, 0.9, -1.2, 1)), {
      left: -1.3,
      right: 0.9,
      up: -1,
      down: 1.2,
    });
  });

  it('stays as it is where the eye looks along the axis of the head', () => {
    const frustum = { left: -1.3, right: 0.9, up: -1, down: 1.2 };
    const turned = axis_angle([0, 1, 0], 0.7);
    expect_frustum(along_axes_of(turned, turned, frustum), frustum);
  });

  it.each([-10, -5, 5, 10])(
    'contains all that an eye sees that is turned by %i degrees',
    (turn) => {
      const frustum = { left: -1.1, right: 0.8, up: -1, down: 1.2 };
      const eye = axis_angle([0, 1, 0], degrees(turn));
      const all = along_axes_of(identity, eye, frustum);
      let [widest, highest] = [0, 0];
      for (let i = 0; i <= 20; ++i)
        for (let k = 0; k <= 20; ++k) {
          const x = frustum.left + ((frustum.right - frustum.left) * i) / 20;
          const y = frustum.up + ((frustum.down - frustum.up) * k) / 20;
          const [a, b, c] = rotate(eye, [x, y, 1]);
          expect(a / c).toBeGreaterThanOrEqual(all.left - 1e-9);
          expect(a / c).toBeLessThanOrEqual(all.right + 1e-9);
          expect(b / c).toBeGreaterThanOrEqual(all.up - 1e-9);
          expect(b / c).toBeLessThanOrEqual(all.down + 1e-9);
          widest = Math.max(widest, Math.abs(a / c));
          highest = Math.max(highest, Math.abs(b / c));
        }
      // And no more than that.
      expect(Math.max(-all.left, all.right)).toBeCloseTo(widest, 6);
      expect(Math.max(-all.up, all.down)).toBeCloseTo(highest, 6);
    },
  );

  it('keeps to the range of the wire, however far the eye is turned', () => {
    const wide = along_axes_of(identity, axis_angle([0, 1, 0], degrees(60)), {
      left: -1,
      right: 2,
      up: -1,
      down: 1,
    });
    for (const side of Object.values(wide) as number[])
      expect(Math.abs(side)).toBeLessThanOrEqual(10);
    expect(wide.right).toBe(10);
  });

  it('widens about its middle', () => {
    expect_frustum(widened_frustum({ left: -1, right: 0.5, up: -1, down: 1 }, { x: 2, y: 1.5 }), {
      left: -1.75,
      right: 1.25,
      up: -1.5,
      down: 1.5,
    });
  });
});

describe('the warp between frusta', () => {
  const picture: Eye = {
    position: [0.1, 0, 0],
    orientation: axis_angle([0, 1, 0], 0.1),
    fov_y_rad: 1.2,
  };
  const view: Eye = {
    position: [0, 0.05, 0.2],
    orientation: axis_angle([1, 0, 0], 0.07),
    fov_y_rad: 0.9,
  };

  it.each([2, Infinity])(
    'is that of cameras whose axis is in the middle, at distance %d',
    (distance) => {
      const m = frustum_warp(
        { ...picture, frustum: frustum_of_eye(picture, 1.5) },
        { ...view, frustum: frustum_of_eye(view, 1.3) },
        distance,
      );
      const same = warp_matrix(picture, view, 1.5, distance, 1.3);
      for (const [x, y] of [
        [0, 0],
        [-0.8, 0.6],
        [1, 1],
      ] as const)
        warped(m, x, y)!.forEach((v, i) => expect(v).toBeCloseTo(warped(same, x, y)![i]!, 4));
    },
  );

  it('finds a point of the scene in the picture of an eye whose axis is aside', () => {
    const frustum = { left: -1.3, right: 0.9, up: -1, down: 1.2 };
    const point: Vec3 = [0.4, -0.3, 2];
    const place = (pose: Pose): readonly [number, number] => {
      const inverse: Quat = [
        -pose.orientation[0],
        -pose.orientation[1],
        -pose.orientation[2],
        pose.orientation[3],
      ];
      const [x, y, z] = rotate(inverse, sub(point, pose.position));
      return [(x / z + 0.2) / 1.1, (y / z - 0.1) / 1.1];
    };
    const eye: Pose = { position: [0.2, 0.1, 0.3], orientation: axis_angle([0, 1, 0], 0.15) };
    const from: Pose = { position: [0, 0, 0], orientation: identity };
    const [u, v] = place(from);
    const inverse_depths = new Float32Array([1 / 2]);
    const mesh = placed_mesh(
      { columns: 1, rows: 1, inverse_depths, distance: 2, nearest: 0.5 },
      (distance) => frustum_warp({ ...eye, frustum }, { ...from, frustum }, distance),
      1,
    );
    // The picture is a plane here, and the points of its mesh give the homography.
    const at = (i: number): Vec3 => [mesh[6 * i]!, mesh[6 * i + 1]!, mesh[6 * i + 2]!];
    const middle = at(4);
    const [x, y, w] = add(middle, add(scale(sub(at(5), middle), u), scale(sub(at(7), middle), v)));
    const [a, b] = place(eye);
    expect(x / w).toBeCloseTo(a, 4);
    expect(y / w).toBeCloseTo(b, 4);
  });
});

const xyz = ([x, y, z]: Vec3): { x: number; y: number; z: number } => ({ x, y, z });
/** A transform of WebXR at this place, turned about its y axis. */
const transform = (position: Vec3, left_rad = 0) => ({
  position: xyz(position),
  orientation: { x: 0, y: Math.sin(left_rad / 2), z: 0, w: Math.cos(left_rad / 2) },
});

const viewer = (left_rad = 0) => ({
  transform: transform([0, 1.6, 0], left_rad),
  views: [
    {
      eye: 'left',
      projectionMatrix: projection(-1.2, 0.9, -1.1, 1),
      transform: transform([-0.03, 1.6, 0]),
    },
    {
      eye: 'right',
      projectionMatrix: projection(-0.9, 1.2, -1.1, 1),
      transform: transform([0.03, 1.6, 0]),
    },
  ],
});

describe('a head', () => {
  it('is in the middle of its eyes', () => {
    const { pose, eyes } = head_of(viewer());
    expect_vec(pose.position, [0, -1.6, 0], 6);
    expect(eyes.map(({ half }) => half)).toEqual([0, 1]);
    expect_vec(eyes[0]!.offset, [-0.03, 0, 0], 6);
    expect_vec(eyes[1]!.offset, [0.03, 0, 0], 6);
  });

  it('looks to the left where WebXR says so', () => {
    const { orientation } = pose_in_room(transform([0, 0, 0], degrees(90)));
    expect_vec(rotate(orientation, forward), [-1, 0, 0], 6);
  });

  it('asks the server for both eyes, with overscan and in units of the scene', () => {
    const { settings, fov_y_rad } = stream_for(head_of(viewer()), {
      overscan: { x: 1.26, y: 1.12 },
      height_px: 1000,
      most_px: 8192,
      rate_hz: 72,
      units_per_metre: 10,
    })!;
    const { stereo } = settings;
    expect(stereo?.left?.rightOfPose).toBeCloseTo(-0.3, 6);
    expect(stereo?.right?.rightOfPose).toBeCloseTo(0.3, 6);
    expect(stereo?.left?.left).toBeCloseTo(-0.15 - 1.05 * 1.26, 6);
    expect(stereo?.right?.down).toBeCloseTo(0.05 + 1.05 * 1.12, 6);
    expect(settings).toMatchObject({ heightPx: 1120, maxFps: 72, depths: true });
    expect(settings.widthPx! % 4).toBe(0); // each eye has an even width
    expect(settings.widthPx! / 2).toBeCloseTo(1000 * 1.26, -1);
    // A server that draws one eye has to show both of them.
    const half = Math.tan(fov_y_rad / 2);
    expect(half).toBeGreaterThanOrEqual(stereo!.right!.down! - 1e-6);
    expect((half * settings.widthPx!) / 1120).toBeGreaterThanOrEqual(stereo!.right!.right! - 1e-6);
  });

  it('asks again when something has changed that can be seen', () => {
    const wanted = { overscan: { x: 1.26, y: 1.12 }, height_px: 1000, most_px: 8192, rate_hz: 72 };
    const stream = (change: (of: ReturnType<typeof viewer>) => void, units_per_metre = 10) => {
      const given = structuredClone(viewer());
      change(given);
      return stream_for(head_of(given), { ...wanted, units_per_metre });
    };
    const first = stream(() => undefined);
    const moved_by = (x: number, y: number) =>
      stream(({ views }) => {
        views[1]!.transform.position.x += x;
        views[1]!.transform.position.y += y;
      });
    expect(same_stream(first, moved_by(1e-6, -1e-7), 10)).toBe(true);
    expect(same_stream(first, moved_by(2e-3, 0), 10)).toBe(false);
    expect(
      same_stream(
        first,
        stream(() => undefined, 11),
        11,
      ),
    ).toBe(false);
    expect(same_stream(undefined, first, 10)).toBe(false);
    const wide = stream(({ views }) => (views[0]!.projectionMatrix[0] = 0.9));
    expect(same_stream(first, wide, 10)).toBe(false);
  });

  it('asks for no more pixels than a picture may have', () => {
    const wanted = {
      overscan: { x: 1.6, y: 1.26 },
      height_px: 3000,
      rate_hz: 90,
      units_per_metre: 1,
    };
    const { settings } = stream_for(head_of(viewer()), { ...wanted, most_px: 4096 })!;
    expect(settings.widthPx).toBeLessThanOrEqual(4100);
    expect(settings.widthPx! / settings.heightPx!).toBeCloseTo((2 * 1.6) / 1.26, 1);
  });

  it('sees its half of a picture from where that eye was', () => {
    const header = create(FrameHeaderSchema, {
      widthPx: 2000,
      heightPx: 1000,
      fovYRad: 1,
      stereo: {
        left: { rightOfPose: -0.3, left: -1.2, right: 0.9, up: -1, down: 1.1 },
        right: { rightOfPose: 0.3, left: -0.9, right: 1.2, up: -1, down: 1.1 },
      },
    });
    const camera = {
      position: [5, 0, 0],
      orientation: axis_angle([0, 1, 0], degrees(90)),
    } as const;
    expect_vec(picture_for(1, header, camera).position, [5, 0, -0.3], 6);
    expect(picture_for(0, header, camera).frustum.left).toBeCloseTo(-1.2, 6);
    // A server without pictures of both eyes sends one, which both see.
    const mono = picture_for(
      1,
      create(FrameHeaderSchema, { widthPx: 2000, heightPx: 1000, fovYRad: 1 }),
      camera,
    );
    expect(mono.position).toEqual([5, 0, 0]);
    expect(mono.frustum.right).toBeCloseTo(2 * Math.tan(0.5), 6);
  });

  it.each([
    [[72, 80, 90, 120], 60, 72],
    [[72, 80, 90, 120], 80, 80],
    [[60, 72], 120, 72],
    [[60], 60, 60],
    [undefined, 60, undefined],
    [[], 60, undefined],
  ])('of %j Hz and %i frames a second takes %s', (supported, fps, rate) => {
    expect(rate_for(supported, fps)).toBe(rate);
  });

  it('has the size of people, as far as anybody knows', () => {
    expect(units_per_metre_of(0.5, 3.2, 70)).toBe(2);
    expect(units_per_metre_of(undefined, 3.2, 70)).toBe(2);
    expect(units_per_metre_of(undefined, undefined, 70)).toBe(10);
  });
});

describe('the overscan of a headset', () => {
  it('is always there, and grows for a head that turns fast', () => {
    const overscan = new HeadsetOverscan();
    const frustum = { left: -1, right: 1, up: -1, down: 1 };
    expect(overscan.sides).toEqual({ x: 1.26, y: 1.12 });
    const turned = (angle: number): Quat => multiply(identity, axis_angle([0, 1, 0], angle));
    let changed = false;
    // 3 rad/s, and pictures 100 ms late.
    for (let i = 0; i < 60; ++i) {
      const time_us = i * 14_000;
      const eye = { position: [0, 0, 0], orientation: turned(i * 0.042), fov_y_rad: 1 } as const;
      overscan.moved({ pose_id: i, time_us, eye, distance: Infinity });
      const picture = {
        ...eye,
        orientation: turned(i * 0.042 - 0.3),
        frustum: widened_frustum(frustum, overscan.sides),
      };
      changed = overscan.drawn(picture, eye, frustum, Infinity, time_us) || changed;
    }
    expect(changed).toBe(true);
    expect(overscan.sides.x).toBe(1.6);
  });
});
