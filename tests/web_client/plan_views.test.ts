// Orthographic views and section boxes, without a page.
import { describe, expect, it, vi } from 'vitest';
import {
  add,
  dot,
  forward,
  identity,
  length,
  rotate,
  scale,
  sub,
  type Vec3,
} from '#client/base/vector';
import { elevation_eye, elevation_of, elevations, extent_along } from '#client/camera/elevation';
import { widened, type Eye } from '#client/camera/eye';
import { glide, pursuit } from '#client/camera/flight';
import { OrthographicController } from '#client/camera/orthographic_controller';
import { project, ray_through } from '#client/camera/ray';
import { section_of, type Section } from '#client/camera/section';
import {
  box_around,
  clip_box,
  section_about,
  section_of_box,
  upright_axes,
} from '#client/camera/upright_box';
import { Clipping } from '#client/page/clipping';
import type { Navigation } from '#client/page/navigation';
import { Signal } from '#client/base/signal';
import { SceneCoordinates } from '#client/session/camera_messages';
import { read_shared, share_address } from '#client/tour/share';
import { read_tours, write_tours } from '#client/tour/tour';
import { with_side } from '#client/ui/section_box';
import type { WorkerClient } from '#client/worker/client';
import { camera, expect_vec, gesture, hold } from './cameras';

const up: Vec3 = [0, -1, 0];
const plan: Eye = { position: [1, -9, 3], orientation: identity, fov_y_rad: 1, view_height: 8 };
const box = { centre: [1, -2, 3], size: [6, 4, 2], turn_rad: 0.3 } as const;
const section = section_of_box(box);

describe('an orthographic camera', () => {
  const in_plan = () => {
    const made = camera();
    const before = made.eye;
    made.load_orthographic((rig) => new OrthographicController(rig));
    made.jump(plan);
    return { made, before };
  };

  it('moves in its plane, beyond the limits of the scene, and turns for nothing', () => {
    const { made } = in_plan();
    for (const kind of ['look', 'pan'] as const) {
      const { position } = made.pose;
      gesture(made, { kind, dx: 0.25, dy: 1 });
      expect_vec(made.pose.position, add(position, [-2, -8, 0]));
      expect(made.pose.orientation).toEqual(identity);
    }
    expect(made.pose.position[1]).toBeLessThan(-20);
    expect([made.step(0.016), made.at_rest]).toEqual([false, true]);
    const { position } = made.pose;
    hold(made, { right: 1, turn_up: 1 });
    expect(made.pose.position[0]).toBeCloseTo(position[0] + 0.6 * 8, 1);
    expect(made.pose.position[1]).toBeCloseTo(position[1] - 0.6 * 8, 1);
  });

  it('zooms by wheel and by keys, and stays where it is', () => {
    const { made } = in_plan();
    gesture(made, { kind: 'dolly', steps: 1 });
    expect(made.eye.view_height).toBeCloseTo(8 * 0.88, 5);
    hold(made, { up: 1 });
    expect(made.eye.view_height).toBeGreaterThan(10);
    gesture(made, { kind: 'dolly', steps: -1000 });
    expect(made.eye.view_height).toBeLessThanOrEqual(5e4);
    expect(made.pose).toMatchObject({ position: plan.position });
  });

  it('goes back to where it was, also by another mode, and to the start by reset', () => {
    for (const leave of ['leave', 'fly', 'orbit', 'reset'] as const) {
      const { made, before } = in_plan();
      expect(made.is_orthographic).toBe(true);
      if (leave === 'leave') made.leave_orthographic();
      else if (leave === 'reset') made.reset();
      else made.set_mode(leave);
      expect(made.eye.view_height).toBeUndefined();
      expect_vec(made.pose.position, before.position);
    }
  });

  it('circles what the visitor looked at before', () => {
    const { made, before } = in_plan();
    expect(made.perspective_eye).toEqual(before);
    made.leave_orthographic();
    gesture(made, { kind: 'look', dx: 0.2, dy: 0 });
    expect(length(sub(made.pose.position, before.position))).toBeGreaterThan(1);
    expect(length(made.pose.position)).toBeCloseTo(length(before.position), 5);
  });

  it('is no higher and no lower than the wire takes', () => {
    for (const [view_height, wanted] of [
      [9e8, 1e9],
      [1e-7, 1e-6],
      [8, 10],
    ] as const)
      expect(widened({ ...plan, view_height }, 1.25).view_height).toBe(wanted);
    const tiny = camera('orbit', { scale: 1e-4 });
    tiny.load_orthographic((rig) => new OrthographicController(rig));
    tiny.jump({ ...plan, view_height: 1e-5 });
    gesture(tiny, { kind: 'dolly', steps: 1000 });
    expect(tiny.eye.view_height).toBe(1e-6);
  });

  it('flies from plan to plan, and cuts to a perspective view', () => {
    const to = { ...plan, position: [5, -9, 3] as const, view_height: 2 };
    const way = glide(plan, to, 2);
    expect(way.at(1).view_height).toBeCloseTo(4, 5);
    expect(way.at(2)).toMatchObject({ view_height: 2, position: to.position });
    const cut = glide(plan, { ...plan, view_height: undefined }, 2);
    expect([cut.duration_s, cut.at(0).view_height]).toEqual([0, undefined]);
    const perspective = { ...plan, position: [0, 0, 0] as const, view_height: undefined };
    for (const [from, end] of [
      [perspective, plan],
      [plan, perspective],
    ] as const)
      expect(pursuit(from, end).at(0.01)).toEqual(end);
  });

  it('sees along parallel rays', () => {
    const ray = ray_through(plan, 0.75, 0.25, 2);
    expect_vec(ray.origin, [5, -11, 3]);
    expect_vec(ray.direction, [0, 0, 1]);
    for (const depth of [0.5, 30])
      expect_vec(project(add(ray.origin, scale(ray.direction, depth)), plan, 2)!, [0.75, 0.25]);
    expect(project(add(ray.origin, [0, 0, -1]), plan, 2)).toBeUndefined();
  });
});

describe('plan and elevations', () => {
  it.each([
    [[0, -1, 0] as Vec3],
    [[0, 0, 1] as Vec3],
    [[0.6, 0.8, 0] as Vec3],
    [[1, 0, 0] as Vec3],
  ])('show all of the box from outside, with up %j', (axis) => {
    const [width, depth, height] = upright_axes(axis, box.turn_rad);
    expect_vec(rotate(identity, height), axis);
    expect(dot(width, axis)).toBeCloseTo(0, 9);
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) =>
      [width, depth, height].reduce<Vec3>(
        (sum, v, i) => add(sum, scale(v, (((bits >> i) & 1) - 0.5) * box.size[i]!)),
        box.centre,
      ),
    );
    for (const elevation of elevations) {
      const eye = elevation_eye(elevation, box, axis, 1.5, 1, 0.1);
      const seen = corners.map((corner) => project(corner, eye, 1.5)!);
      const most = Math.max(...seen.flat().map((v) => Math.abs(v - 0.5)));
      expect(most).toBeCloseTo(0.5 / 1.3, 5);
      expect(elevation_of(eye, box.turn_rad, axis)).toBe(elevation);
      // The picture's up: the scene's, and in a plan the box's depth.
      const above = rotate(eye.orientation, [0, -1, 0]);
      expect_vec(above, elevation === 'plan' ? depth : axis);
    }
    expect(elevation_of(elevation_eye('front', box, axis, 1.5, 1, 0.1), 1, axis)).toBeUndefined();
  });

  it.each([[0.01], [0.2], [50]])(
    'show a box %f high that the near plane cuts nothing of',
    (high) => {
      for (const elevation of elevations) {
        const flat = { ...box, size: [6, 0.01, high] as const };
        const { position, orientation } = elevation_eye(elevation, flat, up, 1, 1, 0.2);
        const view = rotate(orientation, forward);
        const depth = dot(sub(box.centre, position), view);
        expect(depth - extent_along(flat, up, view) / 2).toBeGreaterThan(0.3);
      }
    },
  );

  it('look at the sides that they are named for', () => {
    const from = (name: 'right' | 'front' | 'plan'): Vec3 =>
      elevation_eye(name, { ...box, turn_rad: 0 }, up, 1, 1, 0.1).position;
    expect_vec(from('right'), [7, -2, 3]);
    expect_vec(from('front'), [1, -2, -1]);
    expect_vec(from('plan'), [1, -4, 3]);
  });
});

describe('a section', () => {
  it('is a box on the wire, about the origin of the scene', () => {
    const { box: sent } = new SceneCoordinates({
      origin: { x: 100, y: 0, z: 0 },
    } as never).clip_message(clip_box(section_of_box({ ...box, turn_rad: 0 }), up, undefined));
    expect(sent).toMatchObject({
      worldFromBox: { position: { x: -99, y: -2, z: 3 } },
      halfExtent: { x: 3, y: 2, z: 1 },
    });
    const { x, y, z, w } = sent!.worldFromBox!.orientation as Record<'x' | 'y' | 'z' | 'w', number>;
    expect_vec(rotate([x, y, z, w], [0, 0, 1]), up);
    expect_vec(rotate([x, y, z, w], [1, 0, 0]), [1, 0, 0]);
  });

  it('ends under the ceiling of a dollhouse', () => {
    const cut = clip_box(section, up, { normal: [0, -2, 0], offset: 5 }); // up to a height of 2.5
    expect(cut.half_extent[2]).toBeCloseTo(0.75, 5);
    expect_vec(cut.world_from_box.position, [1, -1.75, 3]);
    expect(clip_box(section, up, { normal: up, offset: -50 }).half_extent[2]).toBeGreaterThan(0);
  });

  it('grows and shrinks by one side', () => {
    const wider = with_side({ ...box, turn_rad: 0 }, { axis: 0, sign: 1 }, 2, up, 0.1);
    expect(wider.size).toEqual([8, 4, 2]);
    expect_vec(wider.centre, [2, -2, 3]);
    const least = with_side(box, { axis: 2, sign: 1 }, -9, up, 0.1);
    expect(least.size[2]).toBe(0.1);
    expect_vec(least.centre, [1, -1.05, 3]); // the floor stays
  });

  it('has sides that the wire takes, around flat content and however they are dragged', () => {
    const flat = box_around({ min: [-1, 2, -1], max: [1, 2, 1] }, up, 0, 5);
    expect_vec(flat.size, [2.2, 2.2, 5e-3]);
    const point = box_around({ min: [1, 2, 3], max: [1, 2, 3] }, up, 0, 1e-9);
    const [x, y, z] = with_side(box, { axis: 0, sign: 1 }, 1e12, up, 0).size;
    expect([...point.size, x, y, z]).toEqual([1e-5, 1e-5, 1e-5, 1e9, 4, 2]);
    expect(with_side(box, { axis: 1, sign: 1 }, -1e12, up, 1e-9).size[1]).toBe(1e-5);
    expect(section_of(section_of_box(point))).toBeDefined();
    const clip = clip_box([0, 0, 0, 0, 1e12, 0, 0], up, undefined);
    expect(clip.half_extent).toEqual([5e-6, 5e8, 5e-6]);
  });

  it.each([[[0, 1, 0] as Vec3], [[1, 0, 0] as Vec3], [[0, 0, -1] as Vec3]])(
    'is the same box when %j is up',
    (to) => {
      const level = section_of_box({ ...box, turn_rad: 0 });
      const faces = (about: Vec3, of: Section): string[] => {
        const { half_extent, world_from_box } = clip_box(of, about, undefined);
        return [0, 1, 2].flatMap((i) => {
          const axis = [0, 0, 0].map((_, k) => (k === i ? half_extent[i]! : 0)) as unknown as Vec3;
          const out = rotate(world_from_box.orientation, axis);
          return [out, scale(out, -1)].map((v) => v.map((x) => (x + 0).toFixed(4)).join());
        });
      };
      const plain = (list: string[]): string[] =>
        list.map((v) => v.replaceAll('-0.0000', '0.0000')).sort();
      const turned = section_about(level, up, to);
      expect(plain(faces(to, turned))).toEqual(plain(faces(up, level)));
      expect(section_about(level, up, up)).toBe(level);
    },
  );

  it('stays where it is when the scene is turned over', () => {
    expect_vec(section_about(section, up, [0, 1, 0]), [...section.slice(0, 6), -section[6]!]);
  });

  it('and the ceiling are told to the server, and a new scene has neither', async () => {
    const { clips, navigation, clipping, told } = make_clipping();
    const ceiling = { normal: up, offset: 2.5 };
    clipping.ceiling = ceiling;
    expect(clips).toEqual([ceiling]);
    clipping.section = section;
    await told(clip_box(section, up, ceiling));
    clipping.ceiling = undefined;
    await told(clip_box(section, up, undefined));
    clipping.section = undefined;
    expect(clips).toHaveLength(4);
    expect(clips[3]).toBeUndefined();
    clipping.section = section;
    navigation.entered.emit(undefined as never);
    expect(clipping.section).toBeUndefined();
  });

  it('of a stop is about the up of the scene, and stays when the visitor chooses another', async () => {
    const { navigation, clipping, told } = make_clipping();
    const over = scale(up, -1);
    navigation.camera.up = over;
    const turned = section_about(section, up, over);
    clipping.show(section);
    await told(clip_box(turned, over, undefined));
    expect(clipping.section).toEqual(turned);
    navigation.camera.up = up;
    navigation.up_changed.emit();
    await vi.waitFor(() => expect_vec(clipping.section!, section));
  });

  it('that the visitor changes ends what leads the camera', () => {
    const { navigation, clipping } = make_clipping();
    const taken = vi.fn();
    navigation.taken_over.listen(taken);
    clipping.show(section);
    expect(taken).not.toHaveBeenCalled();
    clipping.edit(section_of_box(box));
    expect(taken).toHaveBeenCalledOnce();
  });

  it('is told again at the next welcome where its part could not load', async () => {
    vi.useFakeTimers();
    vi.spyOn(console, 'warn').mockImplementation(() => undefined);
    vi.doMock('#client/camera/upright_box', () => {
      throw new Error('the server is away');
    });
    const { clips, clipping, worker, told } = make_clipping();
    clipping.section = section;
    await vi.waitFor(() => {
      vi.advanceTimersByTime(30_000);
      expect(console.warn).toHaveBeenCalled();
    });
    vi.doUnmock('#client/camera/upright_box');
    vi.useRealTimers();
    expect(clips).toEqual([]);
    worker.heard.get('welcome')!();
    await told(clip_box(section, up, undefined));
    vi.restoreAllMocks();
  });
});

function make_clipping() {
  const clips: unknown[] = [];
  const heard = new Map<string, () => void>();
  const worker = {
    heard,
    post: ({ clip }: { clip: unknown }) => clips.push(clip),
    on: (kind: string, listener: () => void) => heard.set(kind, listener),
  };
  const navigation = {
    entered: new Signal(),
    up_changed: new Signal(),
    taken_over: new Signal(),
    camera: { up },
    own_up: up,
  };
  const clipping = new Clipping(
    worker as unknown as WorkerClient,
    navigation as unknown as Navigation,
  );
  const told = (clip: unknown): Promise<void> =>
    vi.waitFor(() => expect(clips[clips.length - 1]).toEqual(clip));
  return { clips, navigation, clipping, worker, told };
}

describe('links and tours', () => {
  it('keep the scale and the section', () => {
    const nowhere = { mode: undefined, tour_index: undefined, stop_index: undefined };
    const address = share_address('http://host/', '', { ...nowhere, eye: plan, section });
    const { eye, section: read } = read_shared(address);
    expect(eye?.view_height).toBe(8);
    expect_vec(read!, section, 4);
    const old = read_shared('http://host/#at=0,0,0,0,0,0,1,60');
    expect([old.eye?.view_height, old.section]).toEqual([undefined, undefined]);
  });

  it.each([['1,2,3,4,5,6'], ['1,2,3,4,0,6,0'], ['1,2,3,4,-5,6,0'], ['1,2,3,4,x,6,0'], ['']])(
    'have no section of "%s"',
    (written) => {
      expect(read_shared(`http://host/#section=${written}`).section).toBeUndefined();
      expect(section_of(written.split(',').map(Number))).toBeUndefined();
    },
  );

  it('have stops with both', () => {
    const stop = { position: [0, 0, 0], orientation: [0, 0, 0, 1], view_height: 5 };
    const written_box = [1, 2, 3, 4, 5, 6, 90];
    const [tour] = read_tours([{ stops: [{ ...stop, section: written_box }, stop] }], up, 1);
    expect(tour!.stops[0]!.eye.view_height).toBe(5);
    expect(tour!.stops[0]!.section).toEqual(written_box);
    const [written] = write_tours([tour!]) as { stops: Record<string, unknown>[] }[];
    expect(written!.stops[0]).toMatchObject({ view_height: 5, section: written_box });
    expect(written!.stops[1]).not.toHaveProperty('section');
    for (const bad of [
      { view_height: 0 },
      { section: [1, 2, 3] },
      { section: [1, 2, 3, 0, 1, 1, 0] },
    ])
      expect(() => read_tours([{ stops: [{ ...stop, ...bad }] }], up, 1)).toThrow(
        `stops[0].${Object.keys(bad)[0]}`,
      );
  });
});
