// What page and worker say to each other. Structured clones: plain data only.
import type { Pose } from '../camera/camera_controller';
import type { StatsSnapshot } from '../stats/metrics';
import type { FrameHeader, StreamConfig, Welcome } from '../wire/wire';
import type { SessionState } from './state';

export interface View {
  readonly width_px: number; // device pixels
  readonly height_px: number;
  readonly device_pixel_ratio: number;
}

export interface Quality {
  readonly height_px: number; // 0: the view's
  readonly max_fps: number; // 0: the server's default
}

export interface CameraSample {
  readonly pose_id: number;
  readonly time_us: number;
  readonly pose: Pose;
  readonly fov_y_rad: number;
}

export interface Snapshot {
  readonly header: FrameHeader;
  readonly width_px: number;
  readonly height_px: number;
  readonly rgba: Uint8ClampedArray<ArrayBuffer>;
}

export type ToWorker =
  | {
      kind: 'start';
      canvas: OffscreenCanvas;
      url: string;
      page_origin_ms: number;
      token: string;
      scene_id: string;
      view: View;
      quality: Quality;
    }
  | { kind: 'camera'; sample: CameraSample }
  | { kind: 'view'; view: View; quality: Quality }
  | { kind: 'hidden'; hidden: boolean }
  | { kind: 'retry' }
  | { kind: 'token'; token: string }
  | { kind: 'stop' }
  | { kind: 'get_stats'; request: number }
  | { kind: 'get_snapshot'; request: number };

export type FromWorker =
  | { kind: 'state'; state: SessionState }
  | { kind: 'welcome'; welcome: Welcome }
  | { kind: 'config'; config: StreamConfig }
  | { kind: 'presenter'; description: string }
  | { kind: 'notice'; message: string }
  /** The decoders are at their end: the stream is asked for as JPEG pictures. */
  | { kind: 'fallback'; message: string }
  | { kind: 'presented'; pose_id: number; pose: Pose; fov_y_rad: number }
  | { kind: 'stats'; request: number; stats: StatsSnapshot }
  | { kind: 'snapshot'; request: number; snapshot: Snapshot | undefined }
  | { kind: 'broken'; message: string };
