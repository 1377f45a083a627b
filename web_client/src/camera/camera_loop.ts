import type { Clock } from '../base/clock';
import type { CameraController } from './camera_controller';
import type { CameraSample } from './eye';
import type { Inertia } from './inertia';
import { is_held, type Axes } from './movement';

const longest_step_s = 0.1; // a page that was held up does not leap

/**
 * Steps the camera at display rate while there is movement, and hands out one sample per refresh
 * and change. At rest it does not run at all; it begins with a refresh at which nothing moves, and
 * unless a finger is held down, which may move on, the last sample is handed out again to say so.
 */
export class CameraLoop {
  private running_ = false;
  private enabled_ = false;
  private changed_ = false;
  private last_us_ = 0;
  private pose_id_ = 0;
  private newest_: CameraSample | undefined;

  constructor(
    private readonly camera_: CameraController,
    private readonly axes_: () => Axes,
    private readonly is_touched_: () => boolean,
    private readonly inertia_: Inertia,
    private readonly clock_: Clock,
    private readonly send_: (sample: CameraSample) => void,
  ) {}

  /** Id of the newest sample; 0 before the first. */
  get pose_id(): number {
    return this.pose_id_;
  }

  /** The newest sample is not yet what the camera will be at the next refresh. */
  get pending(): boolean {
    return this.running_;
  }

  /** Nothing is sent before the scene has told where the camera starts. */
  enable(): void {
    this.enabled_ = true;
    this.changed();
  }

  /** The camera was put somewhere else, or its field of view changed. */
  changed(): void {
    this.changed_ = true;
    this.wake();
  }

  /** A gesture or a key has come in. */
  wake(): void {
    if (this.running_ || !this.enabled_) return;
    this.running_ = true;
    this.last_us_ = this.clock_.now_us();
    requestAnimationFrame(() => this.tick());
  }

  /** A sample of the camera as it is, at once. Returns its id. */
  sample(): number {
    this.changed_ = false;
    this.pose_id_ += 1;
    this.newest_ = {
      pose_id: this.pose_id_,
      time_us: this.clock_.now_us(),
      eye: { ...this.camera_.pose, fov_y_rad: this.camera_.fov_y_rad },
      distance: this.camera_.sight_distance,
    };
    this.send_(this.newest_);
    return this.pose_id_;
  }

  private tick(): void {
    const now_us = this.clock_.now_us();
    const dt_s = Math.min((now_us - this.last_us_) / 1e6, longest_step_s);
    this.last_us_ = now_us;
    const axes = this.axes_();
    if (is_held(axes)) this.inertia_.stop();
    const glide = this.inertia_.step(dt_s);
    if (glide) this.camera_.gesture(glide);
    const moved = this.camera_.step(dt_s, axes) || this.changed_;
    if (moved) this.sample();
    this.running_ = is_held(axes) || moved || !this.camera_.at_rest || this.inertia_.active;
    if (this.running_) requestAnimationFrame(() => this.tick());
    else if (this.newest_ && !this.is_touched_()) this.send_({ ...this.newest_, at_rest: true });
  }
}
