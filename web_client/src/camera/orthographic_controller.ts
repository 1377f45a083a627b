import { add, dot, length, scale, sub, type Vec3, clamp } from '../base/vector';
import type { CameraRig } from './camera_rig';
import { limited_height, type Eye } from './eye';
import type { ModeController } from './mode';
import type { Axes, Gesture } from './movement';
import type { Movement } from './smoothing';

const zoom_share = 0.12; // of the view's height, a step
const steps_a_view = 10; // of zooming, in the time in which keys cross the view
const fast_factor = 4;
const height_range = [1e-3, 1e4] as const; // of the scene's scale

/** An orthographic view keeps its direction. It moves in its plane, whatever the scene's limits, and zooms. */
export class OrthographicController implements ModeController {
  readonly speed = 0.6; // of the view's height
  readonly drag_rad = 0;
  readonly sight_distance = Infinity;

  constructor(private readonly rig_: CameraRig) {}

  /** All drags pan. */
  asks(gesture: Gesture): Partial<Movement> {
    if (gesture.kind === 'dolly') return { dolly: gesture.steps };
    const { view_height = 0 } = this.rig_;
    return { pan: [-gesture.dx * view_height, -gesture.dy * view_height, 0] };
  }

  /** Keys move the view in its plane, and those of up and down zoom. */
  held(
    { right: x, turn_right, forward: y, turn_up, up, fast }: Axes,
    dt_s: number,
  ): Partial<Movement> {
    const share = this.speed * (fast ? fast_factor : 1) * dt_s;
    const way = share * (this.rig_.view_height ?? 0);
    return {
      pan: [(x + turn_right) * way, -(y + turn_up) * way, 0],
      dolly: -up * share * steps_a_view,
    };
  }

  get heading(): Vec3 {
    return this.rig_.view;
  }

  begin(): undefined {
    return undefined;
  }

  turn(): void {
    // it keeps its direction
  }

  move(movement: Vec3): void {
    if (length(movement) > 0) this.rig_.put(add(this.rig_.pose.position, movement));
  }

  dolly(steps: number): void {
    const { view_height = 1, reach } = this.rig_;
    const [least, most] = height_range;
    const wanted = view_height * (1 - zoom_share) ** steps;
    this.rig_.view_height = limited_height(clamp(wanted, least * reach, most * reach));
  }

  /** The point comes to the middle of the view. */
  approach(point: Vec3): Eye {
    const { pose, view, fov_y_rad, view_height } = this.rig_;
    const way = sub(point, pose.position);
    const position = add(pose.position, sub(way, scale(view, dot(way, view))));
    return { ...pose, position, fov_y_rad, view_height };
  }
}
