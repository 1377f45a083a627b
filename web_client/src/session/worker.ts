// The worker: everything between socket and canvas, so that a busy page delays no picture.
import type { Pose } from '../camera/camera_controller';
import { FramePipeline } from '../decode/frame_pipeline';
import { available_codecs, make_decoder } from '../decode/make_decoder';
import { make_presenter } from '../present/make_presenter';
import { Metrics } from '../stats/metrics';
import { endpoint_of, open_web_socket } from '../transport/socket';
import { Codec, type FrameHeader, type PoseInit, type SettingsInit } from '../wire/wire';
import { browser_timers, clock_from } from './clock';
import type { CameraSample, FromWorker, Quality, ToWorker, View } from './messages';
import { Session } from './session';

type Start = Extract<ToWorker, { kind: 'start' }>;

const scope = self as unknown as {
  postMessage(message: FromWorker, transfer?: Transferable[]): void;
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  requestAnimationFrame(callback: () => void): number;
  onunhandledrejection: ((event: PromiseRejectionEvent) => void) | null;
};

let client: Client | undefined;

// Uncaught exceptions reach the page as the worker's error event; rejections do not.
scope.onunhandledrejection = ({ reason }) => {
  scope.postMessage({ kind: 'broken', message: String(reason) });
};

scope.onmessage = ({ data }) => {
  if (data.kind !== 'start') {
    client?.handle(data);
    return;
  }
  try {
    client = new Client(data);
  } catch (error) {
    scope.postMessage({ kind: 'broken', message: String(error) });
  }
};

class Client {
  private readonly clock_;
  private readonly presenter_;
  private readonly pipeline_: FramePipeline;
  private readonly session_: Session;
  private readonly metrics_ = new Metrics();
  private shown_: FrameHeader | undefined;

  constructor(start: Start) {
    this.clock_ = clock_from(start.page_origin_ms);
    this.presenter_ = make_presenter(start.canvas);
    scope.postMessage({ kind: 'presenter', description: this.presenter_.description });
    this.pipeline_ = this.make_pipeline();
    this.session_ = this.make_session(start);
    this.session_.start();
  }

  handle(message: Exclude<ToWorker, Start>): void {
    switch (message.kind) {
      case 'camera':
        this.metrics_.pose_sent(BigInt(message.sample.pose_id), message.sample.time_us);
        this.session_.send_pose(pose_message(message.sample));
        break;
      case 'view':
        this.session_.set_viewport(...viewport(message.view));
        this.session_.send_settings(settings(message.view, message.quality));
        break;
      case 'hidden':
        this.session_.set_paused(message.hidden);
        if (message.hidden) this.pipeline_.discard_pending();
        break;
      case 'retry':
        this.session_.retry();
        break;
      case 'token':
        this.session_.greet_anew({ token: message.token });
        break;
      case 'stop':
        this.session_.stop();
        break;
      case 'get_stats':
        scope.postMessage({
          kind: 'stats',
          request: message.request,
          stats: this.metrics_.snapshot(this.clock_.now_us()),
        });
        break;
      case 'get_snapshot':
        this.post_snapshot(message.request);
        break;
    }
  }

  private make_pipeline(): FramePipeline {
    const now_us = (): number => this.clock_.now_us();
    return new FramePipeline(
      {
        now_us,
        make_decoder: (config, failures, events) =>
          make_decoder(config, failures, now_us, events),
        on_refresh: (draw) => scope.requestAnimationFrame(draw),
        draw: (picture) => this.presenter_.draw(picture),
      },
      {
        ack: (ack) => this.session_.send_ack(ack),
        presented: (frame, presented_us) => {
          this.shown_ = frame.header;
          this.metrics_.presented(frame, presented_us);
          scope.postMessage({
            kind: 'presented',
            pose_id: Number(frame.header.poseId),
            pose: plain_pose(frame.header.renderPose),
            fov_y_rad: frame.header.fovYRad,
          });
        },
        dropped: () => this.metrics_.dropped(),
        key_frame_wanted: () => this.session_.request_idr(),
        undecodable: (message) => this.fall_back(message),
      },
    );
  }

  private make_session(start: Start): Session {
    const [viewportWidthPx, viewportHeightPx, devicePixelRatio] = viewport(start.view);
    return new Session(
      {
        open: open_web_socket(endpoint_of(start.url)),
        clock: this.clock_,
        timers: browser_timers,
        random: Math.random,
      },
      {
        state: (state) => scope.postMessage({ kind: 'state', state }),
        welcome: (welcome) => scope.postMessage({ kind: 'welcome', welcome }),
        config: (config) => {
          this.metrics_.configured(config);
          this.pipeline_.configure(config);
          scope.postMessage({ kind: 'config', config });
        },
        frame: (header, payload) => {
          this.metrics_.received(payload.length, this.clock_.now_us());
          this.pipeline_.push(header, payload);
        },
        stream_ended: () => this.pipeline_.end_stream(),
        stats: (stats) => this.metrics_.server_said(stats),
        notice: (message) => scope.postMessage({ kind: 'notice', message }),
      },
      {
        sceneId: start.scene_id,
        viewportWidthPx,
        viewportHeightPx,
        devicePixelRatio,
        decoders: available_codecs(),
        token: start.token,
        settings: settings(start.view, start.quality),
      },
    );
  }

  private fall_back(message: string): void {
    scope.postMessage({ kind: 'fallback', message });
    this.session_.greet_anew({ decoders: [Codec.MJPEG] });
  }

  private post_snapshot(request: number): void {
    if (!this.shown_) {
      scope.postMessage({ kind: 'snapshot', request, snapshot: undefined });
      return;
    }
    const pixels = this.presenter_.read();
    scope.postMessage(
      { kind: 'snapshot', request, snapshot: { header: this.shown_, ...pixels } },
      [pixels.rgba.buffer],
    );
  }
}

function viewport(view: View): [width_px: number, height_px: number, ratio: number] {
  return [view.width_px, view.height_px, view.device_pixel_ratio];
}

/** The frame size: the chosen height or the view's, in the view's shape. */
function settings(view: View, quality: Quality): SettingsInit {
  const height_px = quality.height_px > 0 ? quality.height_px : view.height_px;
  return {
    widthPx: frame_side((height_px * view.width_px) / view.height_px),
    heightPx: frame_side(height_px),
    maxFps: quality.max_fps,
  };
}

/** Within the limits of the wire, and even: 4:2:0 video has no odd sides. */
const frame_side = (px: number): number => Math.min(8192, Math.max(16, Math.round(px / 2) * 2));

function pose_message({ pose_id, time_us, pose, fov_y_rad }: CameraSample): PoseInit {
  const [px, py, pz] = pose.position;
  const [x, y, z, w] = pose.orientation;
  return {
    poseId: BigInt(pose_id),
    clientTimeUs: BigInt(Math.round(time_us)),
    worldFromCamera: {
      position: { x: px, y: py, z: pz },
      orientation: { x, y, z, w },
    },
    fovYRad: fov_y_rad,
  };
}

function plain_pose(pose: FrameHeader['renderPose']): Pose {
  const p = pose?.position;
  const q = pose?.orientation;
  return {
    position: [p?.x ?? 0, p?.y ?? 0, p?.z ?? 0],
    orientation: [q?.x ?? 0, q?.y ?? 0, q?.z ?? 0, q?.w ?? 1],
  };
}
