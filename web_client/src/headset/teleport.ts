// A visitor points at where they want to be: on the walkable area by an arc, elsewhere at what is drawn there.
import {
  add,
  cross,
  dot,
  normalize,
  right,
  rotate,
  scale,
  sub,
  axis_angle,
  type Vec3,
} from '../base/vector';
import type { Pose } from '../camera/eye';
import { surface_of, type Ray } from '../camera/ray';
import { to_world, type WalkMap } from '../walk/walk_map';
import { landing, thrown } from './arc';
import type { Colour, Overlay } from './overlay';
import type { RoomRay } from './plate';
import type { Rig } from './rig';

const ask_ms = 250; // four rays at once: the server answers 32 a second
const around_rad = 0.02; // of the ray, for the slope of what it meets
const level_cosine = 0.7; // of a surface that somebody stands on
const before_wall_m = 0.6;
const possible: Colour = [0.45, 0.75, 1, 0.9];
const impossible: Colour = [1, 0.45, 0.35, 0.7];
const down: Vec3 = [0, 1, 0];

interface Scene {
  readonly rig: Rig;
  readonly map: WalkMap | undefined;
  /** Unit, in the world. */
  readonly up: Vec3;
  readonly head: Pose;
  /** As Navigation does it. */
  readonly distance_along: (ray: Ray) => Promise<number>;
}

export class Teleport {
  private is_on_ = false;
  private way_: readonly Vec3[] = []; // in the room
  private target_: Vec3 | undefined; // of the feet, in the world
  private asked_ms_ = -Infinity;
  private begun_ = 0;

  get is_on(): boolean {
    return this.is_on_;
  }

  begin(): void {
    this.is_on_ = true;
    this.begun_ += 1;
    this.target_ = undefined;
    this.way_ = [];
    this.asked_ms_ = -Infinity;
  }

  /** Returns where the visitor wants to stand, in the world, if they can. */
  end(): Vec3 | undefined {
    const target = this.is_on_ ? this.target_ : undefined;
    this.is_on_ = false;
    return target;
  }

  point(ray: RoomRay, scene: Scene, now_ms: number): void {
    const { rig, map } = scene;
    if (map) {
      const points = thrown(ray.origin, ray.direction, down);
      const { stand, points: count } = landing(
        map,
        points.map((p) => rig.point(p)),
      );
      this.target_ = stand && to_world(map, stand);
      const end = this.target_ ? [rig.to_room(this.target_)] : [];
      this.way_ = [...points.slice(0, count), ...end];
      return;
    }
    const end = this.target_ ? rig.to_room(this.target_) : add(ray.origin, scale(ray.direction, 5));
    this.way_ = [ray.origin, end];
    if (now_ms - this.asked_ms_ < ask_ms) return;
    this.asked_ms_ = now_ms;
    const begun = this.begun_;
    void stand_on(ray, scene).then((target) => {
      if (begun === this.begun_) this.target_ = target;
    });
  }

  draw(overlay: Overlay, rig: Rig, eye: Vec3): void {
    if (!this.is_on_ || this.way_.length < 2) return;
    const { target_: target } = this;
    const colour = target ? possible : impossible;
    const begin: Colour = [colour[0], colour[1], colour[2], 0.1];
    overlay.line(this.way_, 0.015, eye, begin, colour);
    if (!target) return;
    const middle = add(rig.to_room(target), [0, -0.02, 0]);
    overlay.ring(middle, right, [0, 0, 1], 0.22, 0.28, colour);
    overlay.ring(middle, right, [0, 0, 1], 0, 0.2, [colour[0], colour[1], colour[2], 0.25]);
  }
}

/** Where somebody stands on what a ray meets, or before it; undefined: it meets nothing. In the world. */
async function stand_on(
  { origin, direction }: RoomRay,
  { rig, up, head, distance_along }: Scene,
): Promise<Vec3 | undefined> {
  const from = rig.point(origin);
  const ahead = rig.direction(direction);
  const aside = normalize(cross(ahead, up), right);
  const rays = [
    [up, 1],
    [up, -1],
    [aside, 1],
    [aside, -1],
  ] as const;
  const floor = rig.floor_below(head);
  const points = await Promise.all(
    rays.map(async ([axis, sign]) => {
      const turned = rotate(axis_angle(axis, sign * around_rad), ahead);
      const distance = await distance_along({ origin: from, direction: turned });
      return distance < Infinity ? add(from, scale(turned, distance)) : undefined;
    }),
  );
  const surface = surface_of(points, from);
  if (!surface) return undefined;
  if (dot(surface.normal, up) > level_cosine) return surface.point;
  const way = sub(surface.point, floor);
  const level = sub(way, scale(up, dot(way, up)));
  const back = scale(normalize(level, aside), before_wall_m * rig.units_per_metre);
  return add(floor, sub(level, back));
}
