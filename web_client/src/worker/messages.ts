// Messages between page and worker. They are structured clones, so they hold plain data only.
import type { Vec3 } from '../base/vector';
import type { CameraSample, Clip, Eye } from '../camera/eye';
import type { PathSample } from '../camera/flight';
import type { Ray } from '../camera/ray';
import type { DecoderRung } from '../decode/ladder';
import type { ShownView } from '../present/display';
import type { PresenterChoice } from '../present/make_presenter';
import type { PresenterKind } from '../present/presenter';
import type { Sides } from '../present/warp';
import type { WarpMode, WarpState } from '../present/warp_policy';
import type { Hit } from '../session/picks';
import type { Quality, View } from '../session/quality';
import type { SessionState } from '../session/state';
import type { StatsReport } from '../stats/metrics';
import type { FrameHeader, Hello_Device, Lead, StreamConfig, Welcome } from '../wire/wire';
import type { HeadsetPicture, HeadsetStream } from './headset';

/** A stop of a tour, or no more than the tour, or nothing. */
export interface ShownStop {
  readonly tour_index: number | undefined;
  readonly stop_index: number | undefined;
  readonly arrived: boolean; // the camera is at the stop
}

export interface Snapshot {
  /** Header of the newest picture. */
  readonly header: FrameHeader;
  /** Camera of the canvas: the picture is warped to where the camera was when it was drawn. */
  readonly view: ShownView;
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
      /** Watch token of a session to follow; '': none. */
      watch: string;
      view: View;
      quality: Quality;
      rung: DecoderRung;
      presenter: PresenterChoice;
      device: Hello_Device;
    }
  | { kind: 'camera'; sample: CameraSample }
  | { kind: 'view'; view: View; quality: Quality }
  | { kind: 'warp'; mode: WarpMode }
  /** Pictures go to the page from now on; undefined: to the canvas again. */
  | { kind: 'headset'; stream: HeadsetStream | undefined }
  /** The page has drawn the picture that it got. `rate_hz`: of the headset, measured. */
  | { kind: 'shown'; seen_us: number; rate_hz: number }
  | { kind: 'path'; samples: readonly PathSample[] }
  | { kind: 'reached'; tour: number; stop: number }
  | { kind: 'pick'; id: number; ray: Ray }
  /** Goes to another scene in this session. A welcome follows, or 'stayed'. */
  | { kind: 'select'; scene_id: string }
  /** The visitor may go to this scene soon. */
  | { kind: 'prepare'; scene_id: string }
  /** Undefined: nothing is left out. */
  | { kind: 'clip'; clip: Clip | undefined }
  /** Which of these points does the scene hide? 'hidden_markers' answers, and tells of changes. */
  | { kind: 'markers'; id: number; points: readonly Vec3[] }
  /** What the visitor sees of the tours, for those in a shared tour with them. */
  | { kind: 'show'; shown: ShownStop }
  | { kind: 'hidden'; hidden: boolean }
  | { kind: 'retry' }
  | { kind: 'token'; token: string }
  /** Begins anew: follows the session of this watch token; '': a visit of one's own. */
  | { kind: 'watch'; watch: string }
  /** Of a visit of one's own: wants the camera of that session; '': no more. */
  | { kind: 'follow'; watch: string }
  /** `pings`: participants may point. `tells_positions`: all hear where everybody is. */
  | { kind: 'present'; on: boolean; name: string; pings: boolean; tells_positions: boolean }
  | { kind: 'ping'; point: Vec3 }
  /** Ends the visit until 'come_back'. */
  | { kind: 'leave' }
  | { kind: 'come_back' }
  /** Ends the visit for good. */
  | { kind: 'stop' }
  | { kind: 'get_stats'; request: number }
  | { kind: 'get_snapshot'; request: number };

export type FromWorker =
  | { kind: 'state'; state: SessionState }
  | { kind: 'welcome'; welcome: Welcome }
  | { kind: 'config'; config: StreamConfig }
  | {
      kind: 'presenter';
      presenter: PresenterKind;
      warp: WarpState;
      warps: boolean;
      overscan: Sides;
    }
  /** To a headset; 'shown' answers it. */
  | HeadsetPicture
  /** Decoding works on this rung here. */
  | { kind: 'rung'; rung: DecoderRung }
  /** Answers a pick. `hit`: undefined where nothing is there. */
  | { kind: 'picked'; id: number; hit: Hit | undefined }
  | { kind: 'hidden_markers'; id: number; indices: readonly number[] }
  /** `eye`: where the host's camera is, for those who follow. */
  | { kind: 'lead'; lead: Lead; eye: Eye | undefined }
  /** Somebody in the shared tour points there. `name`: of the host. */
  | { kind: 'pinged'; point: Vec3; by_host: boolean; name: string }
  /** Where all in the shared tour are, the host first; empty: the server tells it no more. */
  | { kind: 'participants_moved'; positions: readonly Vec3[] }
  | { kind: 'notice'; message: string }
  /** The server did not let the visitor into the scene that was selected. */
  | { kind: 'stayed'; message: string }
  /** No video decoder is left. The worker asks for JPEG pictures instead. */
  | { kind: 'fallback'; message: string }
  | { kind: 'presented'; pose_id: number; eye: Eye }
  | { kind: 'stats'; request: number; stats: StatsReport }
  | { kind: 'snapshot'; request: number; snapshot: Snapshot | undefined }
  /** Something failed in the worker, which goes on. */
  | { kind: 'error'; message: string }
  /** The worker cannot go on. */
  | { kind: 'broken'; message: string };
