// Forecasts how far the view turns away from a picture before the next one replaces it. It only
// decides the overscan: display.ts warps to the newest pose. Pure.
import { percentile, TimeWindow } from '../base/time_window';
import { angle_between, slerp, type Quat } from '../base/vector';
import type { CameraSample, Eye } from '../camera/eye';

const rate_span_us = 80_000; // the rate of a turn is measured over this time
const lag_span_us = 10e6;
const slow_rad_s = 0.2; // slower turns say nothing about the lag
const first_lag_s = 0.1; // before a measurement
const longest_lag_s = 0.4; // beyond that no overscan helps
const largest_turn_rad = 0.5;

/**
 * Multiplies the rate at which the camera turns by the lag of pictures. The lag is the part of motion
 * to photon that the server's own forecast leaves. It is learned from pictures: the angle between a
 * picture and the view, divided by the rate.
 */
export class TurnForecast {
  private samples_: CameraSample[] = [];
  private readonly lags_s_ = new TimeWindow(lag_span_us);

  moved(sample: CameraSample): void {
    const newest = this.samples_[this.samples_.length - 1];
    // After a rest a turn begins anew.
    if (newest && sample.time_us - newest.time_us > 2 * rate_span_us) this.samples_ = [];
    this.samples_.push(sample);
    while (this.samples_.length > 2 && this.samples_[1]!.time_us <= sample.time_us - rate_span_us) {
      this.samples_.shift();
    }
  }

  /** The view was drawn from a picture with this orientation. */
  drawn(picture: Quat, now_us: number): void {
    const { turn_rad, over_s, newest } = this.turn();
    if (!newest || !(turn_rad > slow_rad_s * over_s)) return;
    const lag_s = (angle_between(picture, newest.eye.orientation) * over_s) / turn_rad;
    this.lags_s_.push(now_us, Math.min(lag_s, longest_lag_s));
  }

  /** The camera at the time when the picture of its present pose is about to be replaced. */
  eye_later(now_us: number): Eye | undefined {
    const { turn_rad, over_s, oldest, newest } = this.turn();
    if (!oldest || !newest || !(over_s > 0)) return undefined;
    const lags = this.lags_s_.values(now_us);
    const lag_s = lags.length > 0 ? percentile(lags, 0.9) : first_lag_s;
    const times = Math.min(lag_s / over_s, largest_turn_rad / Math.max(turn_rad, 1e-9));
    const { orientation } = newest.eye;
    return { ...newest.eye, orientation: slerp(oldest.eye.orientation, orientation, 1 + times) };
  }

  private turn(): {
    turn_rad: number;
    over_s: number;
    oldest: CameraSample | undefined;
    newest: CameraSample | undefined;
  } {
    const [oldest] = this.samples_;
    const newest = this.samples_[this.samples_.length - 1];
    if (!oldest || !newest) return { turn_rad: 0, over_s: 0, oldest, newest };
    return {
      turn_rad: angle_between(oldest.eye.orientation, newest.eye.orientation),
      over_s: (newest.time_us - oldest.time_us) / 1e6,
      oldest,
      newest,
    };
  }
}
