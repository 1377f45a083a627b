import type { Clock } from '../base/clock';
import type { CameraController } from './camera_controller';
import type { CameraSample } from './eye';
import type { Inertia } from './inertia';
import { is_held, type Axes } from './movement';

const longest_step_s = 0.1; // the camera does not leap after the page was held up

/**
 * Steps the camera at display rate while something moves it, and sends one sample per refresh and
 * change. It stops at the first refresh at which nothing moves. Then it sends the last sample again,
 * marked as at rest, unless a finger is still down and may move on.
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

  /** The next refresh may move the camera away from the newest sample. */
  get pending(): boolean {
    return this.running_;
  }

  /** Starts to send samples, once the scene has said where the camera starts. */
  enable(): void {
    this.enabled_ = true;
    this.changed();
  }

  /** Something other than a gesture changed the camera or its field of view. */
  changed(): void {
    this.changed_ = true;
    this.wake();
  }

  /** Runs from the next refresh on: a gesture or a key came in. */
  wake(): void {
    if (this.running_ || !this.enabled_) return;
    this.running_ = true;
    this.last_us_ = this.clock_.now_us();
    requestAnimationFrame(() => this.tick());
  }

  /** Sends a sample of the camera at once. `time_us`: when the camera is there. Returns its id. */
  sample(time_us = this.clock_.now_us()): number {
    this.changed_ = false;
    this.pose_id_ += 1;
    this.newest_ = {
      pose_id: this.pose_id_,
      time_us,
      eye: this.camera_.eye,
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
