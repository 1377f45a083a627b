// How much more than the eyes see the server draws, so that a head that turns sees no border. Pure.
import type { CameraSample, Pose } from '../camera/eye';
import { frustum_warp, sides_over, type Frustum, type FrustumView } from '../present/frustum';
import { TurnForecast } from '../present/turn_forecast';
import { reach, type Sides } from '../present/warp';
import { WarpPolicy } from '../present/warp_policy';

/** As the flat page decides it (present/display.ts), but a head always moves: some is always there. */
export class HeadsetOverscan {
  private readonly policy_ = new WarpPolicy(true);
  private turn_ = new TurnForecast();

  constructor() {
    this.policy_.mode = 'on';
  }

  get sides(): Sides {
    return this.policy_.overscan;
  }

  /** The visitor is elsewhere, or looks elsewhere, without having turned. */
  jumped(): void {
    this.turn_ = new TurnForecast();
  }

  moved(sample: CameraSample): void {
    this.turn_.moved(sample);
  }

  /**
   * An eye with this frustum sees the picture from `eye`. `distance`: of what it shows. Returns whether other sides
   * are wanted.
   */
  drawn(
    picture: FrustumView,
    eye: Pose,
    frustum: Frustum,
    distance: number,
    now_us: number,
  ): boolean {
    this.turn_.drawn(picture.orientation, now_us);
    const view = { ...eye, frustum };
    const sides = sides_over(picture.frustum, frustum);
    const shown = reach(frustum_warp(picture, view, distance));
    let needed = { x: shown.x * sides.x, y: shown.y * sides.y };
    const later = this.turn_.eye_later(now_us);
    if (later) {
      const turned = { ...view, orientation: later.orientation };
      const coming = reach(frustum_warp(view, turned, Infinity));
      needed = { x: Math.max(needed.x, coming.x), y: Math.max(needed.y, coming.y) };
    }
    return this.policy_.drawn(needed, 0, now_us);
  }
}
