import { add, length, look_at, normalize, scale, sub, type Vec3 } from '../base/vector';
import type { Eye } from './eye';
import { FlyController } from './fly_controller';

const step_before = 0.1; // of the scene's scale: a visitor stands before what they pointed at

/** The camera looks around as in flight and keeps its height. */
export class WalkController extends FlyController {
  override readonly speed = 0.25;

  override get heading(): Vec3 {
    const { view } = this.rig;
    return normalize(this.rig.on_ground(view), view);
  }

  override allowed(movement: Vec3): Vec3 {
    return this.rig.on_ground(movement);
  }

  /** Stops a step before the point, at the present height, and faces it. */
  override approach(point: Vec3): Eye {
    const { rig } = this;
    const way = rig.on_ground(sub(point, rig.pose.position));
    const distance = Math.max(length(way), 1e-9);
    const gone = Math.max(0, distance - step_before * rig.reach);
    const position = rig.within(add(rig.pose.position, scale(way, gone / distance)));
    const orientation = look_at(position, add(position, way), rig.up);
    return { position, orientation, fov_y_rad: rig.fov_y_rad };
  }
}
