// window.catgs: a small interface for tests and for pages that drive the viewer (EMBED.md).
import { browser_timers, type Clock, type Timers } from '../base/clock';
import type { CameraController } from '../camera/camera_controller';
import { half_height, same_projection, type Pose } from '../camera/eye';
import { same_angle_rad, same_view } from '../camera/same_view';
import type { Navigation } from '../page/navigation';
import type { StatsSnapshot } from '../stats/metrics';
import type { WorkerClient } from '../worker/client';
import type { FromWorker, Snapshot } from '../worker/messages';

interface Automation {
  /** Puts the camera there. Camera axes: x right, y down, z forward; quaternion x, y, z, w. */
  setPose(pose: Pose, fovYRad?: number): void;
  pose(): Pose;
  /** Resolves when the newest pose is shown and its picture has been refined. */
  settled(): Promise<void>;
  /** RGBA pixels of the shown picture at its native size, with the header of its frame. */
  snapshot(): Promise<Snapshot>;
  stats(): Promise<StatsSnapshot>;
}

declare global {
  interface Window {
    catgs?: Automation;
  }
}

type Shown = Extract<FromWorker, { kind: 'presented' }>;

// The server refines a still picture with a few more frames and then falls silent. The time between two
// of them is at most this, or a few of the intervals seen so far.
const least_quiet_ms = 400;
const quiet_intervals = 4;

/** Resolves promises when the picture has come to rest. */
export class Settling {
  private last_shown_ms_ = 0;
  private interval_ms_ = 0;
  private waiting_: (() => void)[] = [];
  private cancel_: () => void = () => undefined;

  /** `is_current`: whether the shown picture is that of the present camera. */
  constructor(
    private readonly is_current_: () => boolean,
    private readonly clock_: Clock,
    private readonly timers_: Timers,
  ) {}

  presented(): void {
    const now_ms = this.clock_.now_us() / 1000;
    this.interval_ms_ = this.last_shown_ms_ > 0 ? now_ms - this.last_shown_ms_ : 0;
    this.last_shown_ms_ = now_ms;
    this.look();
  }

  wait(): Promise<void> {
    return new Promise((resolve) => {
      this.waiting_.push(resolve);
      this.look();
    });
  }

  private look(): void {
    this.cancel_();
    if (this.waiting_.length === 0) return;
    const quiet_ms = Math.max(least_quiet_ms, Math.min(this.interval_ms_, 1000) * quiet_intervals);
    const left_ms = this.last_shown_ms_ + quiet_ms - this.clock_.now_us() / 1000;
    const is_current = this.is_current_();
    if (is_current && left_ms <= 0) {
      for (const resolve of this.waiting_.splice(0)) resolve();
      return;
    }
    // On a busy page the last picture comes before the camera is known to rest.
    this.cancel_ = this.timers_.after(is_current ? left_ms : least_quiet_ms, () => this.look());
  }
}

/** Makes `window.catgs` for a page with these parts. */
export function make_automation(
  worker: WorkerClient,
  { camera, loop, changed }: Navigation,
  clock: Clock,
): Automation {
  let shown: Shown | undefined;
  const settling = new Settling(
    () => shown !== undefined && !loop.pending && shows_camera(shown, camera, loop.pose_id),
    clock,
    browser_timers,
  );
  worker.on('presented', (message) => {
    shown = message;
    settling.presented();
  });
  return {
    setPose: (pose, fov_y_rad) => {
      camera.jump(pose);
      if (fov_y_rad !== undefined) camera.fov_y_rad = fov_y_rad;
      changed.emit();
      loop.sample();
    },
    pose: () => camera.pose,
    settled: () => settling.wait(),
    snapshot: async () => {
      const snapshot = await worker.snapshot();
      if (!snapshot) throw new Error('no picture has been shown yet');
      return snapshot;
    },
    stats: () => worker.stats(),
  };
}

/**
 * Whether the shown picture is that of the present camera. The server does not render a pose again that
 * gives the same picture, so the id of the newest pose may never come back.
 */
export function shows_camera(
  shown: Pick<Shown, 'pose_id' | 'eye'>,
  camera: Pick<CameraController, 'eye' | 'scene'>,
  newest_pose_id: number,
): boolean {
  if (shown.pose_id >= newest_pose_id) return true;
  const { eye } = camera;
  const [a, b] = [half_height(shown.eye), half_height(eye)];
  return (
    same_projection(shown.eye, eye) &&
    Math.abs(a - b) < same_angle_rad * (eye.view_height === undefined ? Math.max(1, b) : b) &&
    same_view(shown.eye, eye, camera.scene)
  );
}
