import { add, multiply, scale, type Quat, type Vec3 } from '../base/vector';
import type { CameraRig } from './camera_rig';
import type { Eye } from './eye';
import type { ModeController } from './mode';

const dolly_share = 0.08; // of the scene's scale, a step

/** The camera turns about itself, and the scene stays under the pointer. */
export class FlyController implements ModeController {
  readonly sight_distance = Infinity;

  constructor(protected readonly rig: CameraRig) {}

  get speed(): number {
    return 0.6;
  }

  get drag_rad(): number {
    return this.rig.fov_y_rad;
  }

  get heading(): Vec3 {
    return this.rig.view;
  }

  begin(): Eye | undefined {
    return undefined; // the camera flies on from where it is
  }

  turn(by: Quat): void {
    const { position, orientation } = this.rig.pose;
    this.rig.pose = { position, orientation: multiply(by, orientation) };
  }

  move(movement: Vec3, climb: number): void {
    this.rig.translate(add(movement, scale(this.rig.up, climb)));
  }

  dolly(steps: number): void {
    this.rig.translate(scale(this.heading, steps * this.rig.reach * dolly_share));
  }

  approach(point: Vec3): Eye {
    return this.rig.facing(point);
  }
}
