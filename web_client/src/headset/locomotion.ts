// How a visitor with a headset gets about: the room of the headset moves through the scene.
import { add, dot, rotate, scale, sub, type Vec3 } from '../base/vector';
import type { Pose } from '../camera/eye';
import type { Navigation } from '../page/navigation';
import { MapWalker } from '../walk/map_walker';
import type { WalkMap } from '../walk/walk_map';
import { units_per_metre_of } from './eyes';
import { level_ahead } from './plate';
import { Rig } from './rig';

const turn_rad = Math.PI / 6;
const walking_m_s = 1.4;
const flight_reach_s = 0.4; // scene scales a second

export class Locomotion {
  rig: Rig;
  private walker_: MapWalker | undefined;
  private made_for_ = '';

  constructor(private readonly navigation_: Navigation) {
    this.rig = new Rig(navigation_.camera.up, 1);
  }

  /**
   * Follows the scene, its up, its walkable area and its scale. `head`: in the room, which moves about it. Returns
   * whether the visitor has another size or stands another way now.
   */
  look(map: WalkMap | undefined, metres_per_unit: number | undefined, head: Pose): boolean {
    if (map !== this.walker_?.map) this.walker_ = map && new MapWalker(map);
    const { up } = this.navigation_.camera;
    const { walker_: walker } = this;
    const units = units_per_metre_of(metres_per_unit, walker?.eye_height, this.navigation_.reach);
    const made_for = JSON.stringify([up, units]);
    if (made_for === this.made_for_) return false;
    const is_first = this.made_for_ === '';
    const { position } = this.rig.to_world(head);
    this.made_for_ = made_for;
    const before = this.rig;
    this.rig = new Rig(up, units);
    if (!is_first) this.place({ ...before.to_world(head), position }, head);
    return !is_first;
  }

  /** Puts the visitor where a camera of the flat page is: on the floor, where that is below it. */
  place(eye: Pose, head: Pose): void {
    this.rig.place(eye, head, this.floor_below(eye.position));
  }

  /** Turns the visitor by so many steps to the right. */
  turn(steps: number, head: Pose): void {
    this.rig.turn(steps * turn_rad, head);
  }

  /** Moves by a stick that is pushed to the right and back. Returns whether the visitor moves. */
  push([x, y]: readonly [number, number], head: Pose, dt_s: number): boolean {
    if (x === 0 && y === 0) return false;
    const { camera } = this.navigation_;
    if (camera.mode === 'walk') this.walk(x, -y, head, dt_s);
    else {
      const speed = flight_reach_s * this.navigation_.reach * camera.speed;
      const { position, orientation } = this.rig.to_world(head);
      const way = scale(rotate(orientation, [x, 0, -y]), speed * dt_s);
      this.rig.move(sub(camera.within(add(position, way)), position));
    }
    return true;
  }

  private walk(aside: number, ahead: number, head: Pose, dt_s: number): void {
    const { rig, walker_: walker } = this;
    const { up } = this.navigation_.camera;
    const forward = level_ahead(head.orientation);
    const right: Vec3 = [forward[2], 0, -forward[0]];
    const wanted = add(scale(forward, ahead), scale(right, aside));
    const way = scale(rig.direction(wanted), walking_m_s * rig.units_per_metre * dt_s);
    const feet = rig.floor_below(head);
    const eyes = walker?.stand_near(add(feet, scale(up, walker.eye_height)));
    if (!walker || !eyes) {
      const { position } = rig.to_world(head);
      return rig.move(sub(this.navigation_.camera.within(add(position, way)), position));
    }
    const stand = add(walker.walk(way), scale(up, -walker.eye_height));
    // From where they stand on the map: somebody who walks in the room may be a little beside it.
    const stood = add(eyes, scale(up, -walker.eye_height));
    const moved = sub(stand, stood);
    const rise = dot(sub(stand, feet), up) - dot(moved, up);
    rig.move(add(moved, scale(up, rise)));
  }

  private floor_below(eyes: Vec3): Vec3 | undefined {
    const { walker_: walker } = this;
    const stand = walker?.stand_near(eyes);
    return stand && walker && add(stand, scale(this.navigation_.camera.up, -walker.eye_height));
  }
}
