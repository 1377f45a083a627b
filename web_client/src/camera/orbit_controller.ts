import {
  add,
  length,
  multiply,
  normalize,
  rotate,
  same,
  scale,
  sub,
  type Quat,
  type Vec3,
} from '../base/vector';
import type { CameraRig } from './camera_rig';
import type { ClearPath } from './clear_path';
import type { Eye } from './eye';
import type { ModeController } from './mode';

const dolly_share = 0.12; // of the distance to the focus, a step
const arc_rad = 0.2; // is asked at once
const width_share = arc_rad ** 2 / 8; // of that distance: the arc stays so near to its chord
const steps_ahead = 30; // are asked at once
const behind_share = 0.1; // of the scene's scale: surfaces are no thicker

/** The camera circles its focus, and passes nothing opaque: there it turns on the spot. */
export class OrbitController implements ModeController {
  readonly speed = 0.6;
  readonly drag_rad = -Math.PI; // a drag to the right takes the camera to the left

  constructor(
    private readonly rig_: CameraRig,
    private readonly way_: ClearPath,
  ) {}

  get sight_distance(): number {
    return this.rig_.distance();
  }

  get heading(): Vec3 {
    return this.rig_.view;
  }

  begin(): undefined {
    this.rig_.refocus();
  }

  turn(by: Quat): void {
    const { pose, focus } = this.rig_;
    const position = add(focus, rotate(by, sub(pose.position, focus)));
    if (!this.rig_.contains(position)) return;
    const orientation = multiply(by, pose.orientation);
    const distance = this.rig_.distance();
    const step = normalize(sub(position, pose.position), [0, 0, 0]);
    const inwards = normalize(sub(focus, pose.position), [0, 0, 0]);
    const chord = normalize(add(step, scale(inwards, arc_rad / 2)), [0, 0, 0]);
    const goes = this.may_go(position, scale(chord, arc_rad * distance));
    this.rig_.pose = { position: goes ? position : pose.position, orientation };
    if (!goes) this.rig_.look_ahead(distance);
  }

  move(movement: Vec3, climb: number): void {
    const by = add(movement, scale(this.rig_.up, climb));
    if (this.may_go(this.rig_.within(add(this.rig_.pose.position, by)))) this.rig_.translate(by);
  }

  settle(): boolean {
    const back = this.way_.take_back();
    if (back) this.rig_.put(back);
    return true;
  }

  /** Moves towards the focus, never through it. */
  dolly(steps: number): void {
    const { pose, focus, nearest } = this.rig_;
    const offset = sub(pose.position, focus);
    const distance = Math.max(length(offset), 1e-9);
    const wanted = distance * (1 - dolly_share) ** steps;
    const target = steps > 0 ? Math.min(distance, Math.max(wanted, nearest)) : wanted;
    const position = add(focus, scale(offset, target / distance));
    if (this.rig_.contains(position) && this.may_go(position))
      this.rig_.pose = { ...pose, position };
  }

  /** Inside, the camera waits for the answer; outside, it comes back where that forbids the way. */
  private may_go(to: Vec3, ahead = scale(sub(to, this.rig_.pose.position), steps_ahead)): boolean {
    const { pose, enclosed, unlimited, nearest, reach } = this.rig_;
    if (unlimited || same(pose.position, to)) return true;
    const width = width_share * this.rig_.distance();
    const clearance = Math.max(width, nearest); // nearer than that, pictures show what is behind
    const behind = enclosed ? behind_share * reach : 0;
    const from = pose.position;
    const allowed = this.way_.allows({ from, to, ahead, width, clearance, behind });
    if (allowed === undefined && !enclosed) this.way_.moved_unchecked(to);
    return allowed ?? !enclosed;
  }

  approach(point: Vec3): Eye {
    return this.rig_.facing(point);
  }
}
