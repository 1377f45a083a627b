import { add, length, multiply, rotate, scale, sub, type Quat, type Vec3 } from '../base/vector';
import type { CameraRig } from './camera_rig';
import type { Eye } from './eye';
import type { ModeController } from './mode';

const dolly_share = 0.12; // of the distance to the focus, a step

/** The camera circles its focus. */
export class OrbitController implements ModeController {
  readonly speed = 0.6;
  readonly drag_rad = -Math.PI; // a drag to the right takes the camera to the left

  constructor(private readonly rig_: CameraRig) {}

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
    this.rig_.pose = { position, orientation: multiply(by, pose.orientation) };
  }

  move(movement: Vec3, climb: number): void {
    this.rig_.translate(add(movement, scale(this.rig_.up, climb)));
  }

  /** Moves towards the focus, never through it. */
  dolly(steps: number): void {
    const { pose, focus, nearest } = this.rig_;
    const offset = sub(pose.position, focus);
    const distance = Math.max(length(offset), 1e-9);
    const wanted = distance * (1 - dolly_share) ** steps;
    const target = steps > 0 ? Math.min(distance, Math.max(wanted, nearest)) : wanted;
    const position = add(focus, scale(offset, target / distance));
    if (this.rig_.contains(position)) this.rig_.pose = { ...pose, position };
  }

  approach(point: Vec3): Eye {
    return this.rig_.facing(point);
  }
}
