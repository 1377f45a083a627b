// Figures for the statistics overlay, window.catgs and the tests, computed from events. Pure.
import { percentile, sum, TimeWindow } from '../base/time_window';
import type { Frame } from '../decode/picture';
import type { Stats, StreamConfig } from '../wire/wire';
import { PoseAge } from './pose_age';

interface Percentiles {
  readonly p50: number;
  readonly p95: number;
}

/** What a frame goes through, in order. `network`: the round trip, for the first picture of each pose. */
export const stages = ['wait', 'render', 'encode', 'send', 'network', 'decode', 'present'] as const;
export type Stage = (typeof stages)[number];

const of_stages = <T>(make: (stage: Stage) => T): Record<Stage, T> =>
  Object.fromEntries(stages.map((stage) => [stage, make(stage)])) as Record<Stage, T>;

/** Latency of pictures of a moving camera; NaN where nothing was measured. */
export interface Motion {
  /** Presentation time minus sample time of the pose, for the first picture of each pose. */
  readonly motion_to_photon_ms: Percentiles;
  readonly pose_age_ms: Percentiles;
  /** Means over frames, from the server's header and the client's clock. */
  readonly stages_ms: Readonly<Record<Stage, number>>;
}

/** Figures of the last seconds; NaN where nothing was measured. */
export interface StatsSnapshot extends Motion {
  readonly fps_shown: number;
  readonly bitrate_kbps: number;
  readonly width_px: number;
  readonly height_px: number;
  readonly frames_shown: number; // since the page was opened
  readonly frames_dropped: number; // never shown by this client
  readonly packets_dropped: number; // never sent by the server
  /** Of the last picture; undefined where the scene is in the server's memory as a whole. */
  readonly pages: PagesDrawn | undefined;
  readonly gpu: GpuUse | undefined; // of the last second in which one drew
  readonly eyes: number; // that the last picture is for; 2: a headset's
  readonly headset_hz: number | undefined; // refreshes of the headset that the visitor wears
}

/** What the server's GPU does for this picture. */
export interface GpuUse {
  readonly frame_ms: number; // mean
  readonly frames_per_list: number;
  readonly lists_left: number; // before their forecast ended
}

/** What the last picture shows of a scene that is read in pages. */
export interface PagesDrawn {
  readonly gaussians: number;
  readonly nodes: number;
  readonly missing_pages: number;
  readonly detail_px: number; // largest error drawn on purpose
  readonly coarsest_px: number; // largest error that memory leaves
  // Levels of the tree that are drawn; 0: every Gaussian.
  readonly finest_level: number;
  readonly coarsest_level: number;
}

/** Present figures, and those of the last time the camera moved. */
export interface StatsReport extends StatsSnapshot {
  readonly last_motion: Motion;
}

const span_us = 2e6;

export class Metrics {
  private readonly shown_ = new TimeWindow(span_us);
  private readonly bytes_ = new TimeWindow(span_us);
  private readonly motion_us_ = new TimeWindow(span_us);
  private readonly pose_age_ = new PoseAge(span_us, 1e6 / 60);
  private readonly stages_us_ = of_stages(() => new TimeWindow(span_us));
  private last_pose_id_ = -1n;
  private frames_shown_ = 0;
  private frames_dropped_ = 0;
  private size_px_: readonly [number, number] = [0, 0];
  private packets_dropped_ = 0;
  private pages_: PagesDrawn | undefined;
  private gpu_: GpuUse | undefined;
  private eyes_ = 1;
  /** Undefined: the visitor wears no headset. */
  headset_hz: number | undefined;

  configured(config: StreamConfig): void {
    this.pose_age_.set_rate(config.fps);
  }

  pose_sent(pose_id: bigint, time_us: number): void {
    this.pose_age_.sent(pose_id, time_us);
  }

  received(bytes: number, now_us: number): void {
    this.bytes_.push(now_us, bytes);
  }

  presented(frame: Frame, now_us: number): void {
    const { header } = frame;
    this.frames_shown_ += 1;
    this.size_px_ = [header.widthPx, header.heightPx];
    this.eyes_ = header.stereo ? 2 : 1;
    this.shown_.push(now_us, 1);
    const pose_time_us = Number(header.poseClientTimeUs);
    // One picture of each pose counts. Pictures before the first pose do not.
    const is_first = header.poseId > 0n && header.poseId !== this.last_pose_id_;
    this.last_pose_id_ = header.poseId;
    if (is_first) this.pose_age_.shown(header.poseId, pose_time_us, now_us);
    // A still comes late on purpose, perhaps in another size.
    if (header.still) return;
    const of = this.stages_us_;
    if (is_first) {
      this.motion_us_.push(now_us, now_us - pose_time_us);
      of.network.push(now_us, network_us(frame));
    }
    of.wait.push(now_us, header.waitUs);
    of.render.push(now_us, header.renderUs);
    of.encode.push(now_us, header.encodeUs);
    of.send.push(now_us, header.sendWaitUs);
    of.decode.push(now_us, frame.decoded_us - frame.received_us);
    of.present.push(now_us, now_us - frame.decoded_us);
  }

  dropped(): void {
    this.frames_dropped_ += 1;
  }

  server_said(stats: Stats): void {
    this.packets_dropped_ = stats.droppedPackets;
    if (stats.deviceMs > 0)
      this.gpu_ = {
        frame_ms: stats.deviceMs,
        frames_per_list: stats.framesPerKey,
        lists_left: stats.windowsCut,
      };
    const in_pages = stats.nodesDrawn > 0;
    this.pages_ = !in_pages
      ? undefined
      : {
          gaussians: stats.gaussiansDrawn,
          nodes: stats.nodesDrawn,
          missing_pages: stats.missingPages,
          detail_px: stats.detailPx,
          coarsest_px: stats.coarsestPx,
          finest_level: stats.finestLevel,
          coarsest_level: stats.coarsestLevel,
        };
  }

  snapshot(now_us: number): StatsReport {
    const per_second = 1e6 / span_us;
    return {
      ...this.motion((window) => window.values(now_us)),
      fps_shown: this.shown_.values(now_us).length * per_second,
      bitrate_kbps: (sum(this.bytes_.values(now_us)) * 8 * per_second) / 1000,
      width_px: this.size_px_[0],
      height_px: this.size_px_[1],
      frames_shown: this.frames_shown_,
      frames_dropped: this.frames_dropped_,
      packets_dropped: this.packets_dropped_,
      pages: this.pages_,
      gpu: this.gpu_,
      eyes: this.eyes_,
      headset_hz: this.headset_hz,
      last_motion: this.motion((window) => window.newest()),
    };
  }

  private motion(of: (window: TimeWindow | PoseAge) => readonly number[]): Motion {
    const mean = (window: TimeWindow): number => {
      const values = of(window);
      return sum(values) / values.length;
    };
    const percentiles_ms = (window: TimeWindow | PoseAge): Percentiles => {
      const values = of(window);
      return { p50: percentile(values, 0.5) / 1000, p95: percentile(values, 0.95) / 1000 };
    };
    return {
      motion_to_photon_ms: percentiles_ms(this.motion_us_),
      pose_age_ms: percentiles_ms(this.pose_age_),
      stages_ms: of_stages((stage) => mean(this.stages_us_[stage]) / 1000),
    };
  }
}

/** Round trip: the time from pose to picture without the time inside the server. */
function network_us({ header, received_us }: Frame): number {
  const server_us = header.waitUs + header.renderUs + header.encodeUs + header.sendWaitUs;
  return received_us - Number(header.poseClientTimeUs) - server_us;
}
