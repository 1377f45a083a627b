// Where the room that a headset tracks lies in the scene. Pure.
// A room has the axes of cameras: x right, y down, z forward; its unit is the metre, and its floor is at y = 0.
import {
  add,
  axis_angle,
  conjugate,
  cross,
  dot,
  forward,
  from_axes,
  identity,
  multiply,
  right,
  rotate,
  normalize,
  scale,
  sub,
  type Quat,
  type Vec3,
} from '../base/vector';
import type { Pose } from '../camera/eye';

interface Xyz {
  readonly x: number;
  readonly y: number;
  readonly z: number;
}

/** A pose of WebXR, whose y points up and whose cameras look along -z, in a room. */
export const pose_in_room = (transform: {
  readonly position: Xyz;
  readonly orientation: Xyz & { readonly w: number };
}): Pose => {
  const { position: p, orientation: q } = transform;
  return { position: [p.x, -p.y, -p.z], orientation: [q.x, -q.y, -q.z, q.w] };
};

/** The level direction of a view, where `down` is a unit vector; that of its upper edge where it looks up or down. */
function heading_of(orientation: Quat, down: Vec3): Vec3 {
  const view = rotate(orientation, forward);
  const above = rotate(orientation, [0, -1, 0]);
  // A view downwards has what is ahead at its upper edge, and one upwards at its lower edge.
  const towards = add(view, scale(above, 1e-3 * Math.sign(dot(view, down) || 1)));
  return normalize(sub(towards, scale(down, dot(towards, down))), right);
}

/** The orientation of a level view with this heading. */
const level = (orientation: Quat, down: Vec3): Quat => {
  const ahead = heading_of(orientation, down);
  return from_axes(cross(down, ahead), down, ahead);
};

const room_down: Vec3 = [0, 1, 0];

export class Rig {
  /** The point of the scene at the origin of the room. */
  position: Vec3 = [0, 0, 0];
  /** Turns axes of the room into the world; level. */
  orientation: Quat = identity;

  constructor(
    /** Unit. */
    private readonly up_: Vec3,
    readonly units_per_metre: number,
  ) {}

  /** Of a point of the room. */
  point(p: Vec3): Vec3 {
    return add(this.position, rotate(this.orientation, scale(p, this.units_per_metre)));
  }

  to_world({ position, orientation }: Pose): Pose {
    return {
      position: this.point(position),
      orientation: multiply(this.orientation, orientation),
    };
  }

  /** A point of the world in the room. */
  to_room(point: Vec3): Vec3 {
    const from_origin = sub(point, this.position);
    return scale(rotate(conjugate(this.orientation), from_origin), 1 / this.units_per_metre);
  }

  direction(d: Vec3): Vec3 {
    return rotate(this.orientation, d);
  }

  /** The point of the floor below the head. */
  floor_below(head: Pose): Vec3 {
    return this.point([head.position[0], 0, head.position[2]]);
  }

  /**
   * Puts the visitor where `eye` is, heading its way. `floor`: where they stand then; undefined: nowhere, and
   * their eyes come to the eye.
   */
  place(eye: Pose, head: Pose, floor?: Vec3): void {
    const down = scale(this.up_, -1);
    const in_room = level(head.orientation, room_down);
    this.orientation = multiply(level(eye.orientation, down), conjugate(in_room));
    this.stand_at(floor ?? add(eye.position, scale(down, this.height_of(head))), head);
  }

  /** Puts the visitor there, without a turn. */
  stand_at(floor: Vec3, head: Pose): void {
    this.move(sub(floor, this.floor_below(head)));
  }

  /** World units and axes. */
  move(by: Vec3): void {
    this.position = add(this.position, by);
  }

  /** Turns the visitor about themselves; angles > 0 turn them to the right. */
  turn(angle_rad: number, head: Pose): void {
    const stays = this.floor_below(head);
    this.orientation = multiply(axis_angle(this.up_, -angle_rad), this.orientation);
    this.stand_at(stays, head);
  }

  /** Of the eyes over the floor of the room, world units. */
  private height_of({ position }: Pose): number {
    return -position[1] * this.units_per_metre;
  }
}
