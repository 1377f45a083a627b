// The worker does everything between socket and canvas, so that a busy page delays no picture.
import { browser_timers, clock_from } from '../base/clock';
import { refreshes } from '../base/patience';
import { widened, type CameraSample, type Eye } from '../camera/eye';
import { FramePipeline } from '../decode/frame_pipeline';
import { failures_per_rung, type DecoderRung } from '../decode/ladder';
import { available_codecs, make_decoder, type MadeDecoder } from '../decode/make_decoder';
import type { DecoderEvents, Picture } from '../decode/picture';
import { Display } from '../present/display';
import { make_presenter } from '../present/make_presenter';
import {
  eye_of,
  eye_of_frame,
  pose_message,
  SceneCoordinates,
  show_message,
} from '../session/camera_messages';
import { Session } from '../session/session';
import type { SessionState } from '../session/state';
import { Metrics } from '../stats/metrics';
import { endpoint_of, open_web_socket } from '../transport/socket';
import {
  Codec,
  type FrameHeader,
  type Lead,
  type SettingsInit,
  type StreamConfig,
} from '../wire/wire';
import { frame_sizes } from './frame_sizes';
import type { HeadsetOutput, HeadsetStream } from './headset';
import type { FromWorker, ToWorker } from './messages';
import { snapshot_of } from './snapshot';

type Start = Extract<ToWorker, { kind: 'start' }>;

const scope = self as unknown as {
  postMessage(message: FromWorker, transfer?: Transferable[]): void;
  onmessage: ((event: MessageEvent<ToWorker>) => void) | null;
  requestAnimationFrame(callback: () => void): number;
  onunhandledrejection: ((event: PromiseRejectionEvent) => void) | null;
};

const say = (message: FromWorker, transfer: Transferable[] = []): void =>
  scope.postMessage(message, transfer);

const on_refresh = refreshes((draw) => scope.requestAnimationFrame(draw), browser_timers);

let client: Client | undefined;

// The page sees uncaught exceptions as the worker's error event, but no rejections.
scope.onunhandledrejection = ({ reason }) => {
  say({ kind: 'error', message: String(reason) });
};

scope.onmessage = ({ data }) => {
  if (data.kind !== 'start') {
    client?.handle(data);
    if (data.kind === 'stop') client = undefined;
    return;
  }
  try {
    client = new Client(data);
  } catch (error) {
    say({ kind: 'broken', message: String(error) });
  }
};

class Client {
  private readonly clock_;
  private readonly presenter_;
  private readonly display_: Display;
  private readonly pipeline_: FramePipeline;
  private readonly session_: Session;
  private readonly metrics_ = new Metrics();
  private shown_: FrameHeader | undefined;
  private view_: Start['view'];
  private quality_: Start['quality'];
  private camera_: CameraSample | undefined;
  private phase_: SessionState['phase'] = 'connecting';
  private host_ = ''; // the name of who presents
  private coordinates_ = new SceneCoordinates();
  private first_rung_: DecoderRung = 'prefer-hardware'; // where the present stream began
  private rung_: DecoderRung; // where the next stream begins on the ladder
  private headset_: HeadsetOutput | undefined; // that the visitor wears

  constructor(start: Start) {
    this.clock_ = clock_from(start.page_origin_ms);
    this.view_ = start.view;
    this.quality_ = start.quality;
    this.rung_ = start.rung;
    this.presenter_ = make_presenter(start.canvas, start.presenter, () =>
      this.session_.send({ case: 'requestIdr', value: {} }),
    );
    const environment = {
      now_us: () => this.clock_.now_us(),
      on_refresh,
      overscan_changed: () => this.send_sizes(),
    };
    this.display_ = new Display(this.presenter_, environment, start.view);
    this.tell_presenter();
    this.pipeline_ = this.make_pipeline();
    this.session_ = this.make_session(start);
    if (start.watch) this.session_.keep({ case: 'follow', value: { watch: start.watch } });
    this.session_.start();
    if (this.presenter_.can_warp) this.load_depth_part();
  }

  /** Pictures are warped without it until then. */
  private load_depth_part(): void {
    import('../present/depth_mesh').then(
      (part) => (this.display_.depth_part = part),
      (error: unknown) => console.warn('no warping by depths', error),
    );
  }

  /** Undefined: the visitor has taken the headset off. */
  private wear(stream: HeadsetStream | undefined): void {
    import('./headset').then(
      ({ output_for }) => {
        this.headset_ = output_for(stream, this.headset_, say);
        if (!stream) this.metrics_.headset_hz = undefined;
        this.send_sizes();
      },
      (error: unknown) => say({ kind: 'error', message: String(error) }),
    );
  }

  handle(message: Exclude<ToWorker, Start>): void {
    switch (message.kind) {
      case 'camera':
        this.take_camera({
          ...message.sample,
          eye: this.coordinates_.to_scene(message.sample.eye),
        });
        break;
      case 'view':
        this.resize(message);
        break;
      case 'warp':
        this.display_.mode = message.mode;
        break;
      case 'headset':
        this.wear(message.stream);
        break;
      case 'shown':
        this.headset_?.shown(message.seen_us);
        this.metrics_.headset_hz = this.headset_ && message.rate_hz;
        break;
      case 'path':
        this.send_path(message);
        break;
      case 'reached':
      case 'pick':
      case 'ping':
      case 'prepare':
        this.send(message);
        break;
      case 'markers':
      case 'show':
      case 'clip':
      case 'follow':
        this.keep(message);
        break;
      case 'select':
        this.session_.select_scene(message.scene_id);
        break;
      case 'hidden':
        this.session_.set_paused(message.hidden);
        this.pipeline_.hidden = message.hidden;
        break;
      case 'token':
        this.session_.greet_anew({ token: message.token });
        break;
      case 'watch':
        this.session_.keep({ case: 'follow', value: { watch: message.watch } });
        this.session_.greet_anew({ watch: message.watch, follow: true });
        break;
      case 'present':
        this.present(message);
        break;
      case 'leave':
      case 'stop':
        this.session_.stop();
        break;
      case 'retry':
      case 'come_back':
        if (message.kind === 'retry' || this.phase_ !== 'failed') this.session_.retry();
        break;
      case 'get_stats':
        this.post_stats(message.request);
        break;
      case 'get_snapshot':
        this.post_snapshot(message.request);
        break;
    }
  }

  private keep(message: Extract<ToWorker, { kind: 'markers' | 'show' | 'clip' | 'follow' }>): void {
    if (message.kind === 'show')
      this.session_.keep({ case: 'show', value: show_message(message.shown) });
    else if (message.kind === 'clip')
      this.session_.keep({ case: 'clip', value: this.coordinates_.clip_message(message.clip) });
    else if (message.kind === 'follow')
      this.session_.keep({ case: 'follow', value: { watch: message.watch } });
    else {
      const points = message.points.map(this.coordinates_.point_message);
      this.session_.keep({ case: 'markers', value: { id: message.id, points } });
    }
  }

  private resize({ view, quality }: Extract<ToWorker, { kind: 'view' }>): void {
    this.view_ = view;
    this.display_.size = view;
    this.quality_ = quality;
    this.send_sizes();
  }

  private post_stats(request: number): void {
    say({ kind: 'stats', request, stats: this.metrics_.snapshot(this.clock_.now_us()) });
  }

  private present(message: Extract<ToWorker, { kind: 'present' }>): void {
    const { on, name, pings, tells_positions } = message;
    // The host's pictures and field of view are also those of participants, who see no warped view.
    this.display_.may_overscan = !on;
    this.session_.keep({
      case: 'present',
      value: { on, name, pings, tellsPlaces: tells_positions },
    });
  }

  private send_path({ samples }: Extract<ToWorker, { kind: 'path' }>): void {
    this.session_.send_path(
      samples.map(({ time_us, eye }) =>
        pose_message(0, time_us, this.widened(this.coordinates_.to_scene(eye))),
      ),
    );
  }

  private send(
    message: Extract<ToWorker, { kind: 'reached' | 'pick' | 'ping' | 'prepare' }>,
  ): void {
    const { session_: session, coordinates_: coordinates } = this;
    if (message.kind === 'reached')
      session.send({ case: 'reached', value: { tour: message.tour, stop: message.stop } });
    else if (message.kind === 'pick')
      session.send({
        case: 'pick',
        value: { id: message.id, ...coordinates.ray_message(message.ray) },
      });
    else if (message.kind === 'ping')
      session.send({ case: 'ping', value: { place: coordinates.point_message(message.point) } });
    else session.send({ case: 'prepare', value: { sceneId: message.scene_id } });
  }

  private make_pipeline(): FramePipeline {
    const now_us = (): number => this.clock_.now_us();
    return new FramePipeline(
      {
        now_us,
        timers: browser_timers,
        make_decoder: (config, failures, events) => this.make_decoder(config, failures, events),
        on_refresh: (draw) => (this.headset_ ? draw() : on_refresh(draw)),
        draw: (picture, header) => this.draw(picture, header),
      },
      {
        ack: (ack) => this.session_.send({ case: 'ack', value: ack }),
        presented: (frame, presented_us) => {
          this.shown_ = frame.header;
          this.metrics_.presented(frame, presented_us);
          say({
            kind: 'presented',
            pose_id: Number(frame.header.poseId),
            eye: this.coordinates_.to_file(
              widened(eye_of_frame(frame.header), 1 / this.display_.overscan.y),
            ),
          });
        },
        dropped: () => this.metrics_.dropped(),
        key_frame_wanted: () => this.session_.send({ case: 'requestIdr', value: {} }),
        undecodable: (message) => this.fall_back(message),
      },
    );
  }

  private async draw(picture: Picture, header: FrameHeader): Promise<number | undefined> {
    const eye = eye_of_frame(header);
    if (this.headset_) return this.headset_.draw(picture, header, this.coordinates_.to_file(eye));
    if (!header.stereo) await this.display_.draw(picture, eye, header);
    else
      await (
        await import('./headset')
      ).draw_left_half(picture, header, (left, its_header) =>
        this.display_.draw(left, eye_of_frame(its_header), its_header),
      );
    return undefined;
  }

  private make_session(start: Start): Session {
    return new Session(
      {
        open: open_web_socket(endpoint_of(start.url)),
        clock: this.clock_,
        timers: browser_timers,
        random: Math.random,
      },
      {
        state: (state) => {
          this.phase_ = state.phase;
          say({ kind: 'state', state });
        },
        welcome: (welcome) => {
          this.coordinates_ = new SceneCoordinates(welcome.scene);
          say({ kind: 'welcome', welcome });
        },
        config: (config) => {
          this.metrics_.configured(config);
          this.pipeline_.configure(config);
          say({ kind: 'config', config });
        },
        frame: (header, payload) => {
          this.metrics_.received(payload.length, this.clock_.now_us());
          this.pipeline_.push(header, payload);
        },
        stream_ended: () => this.pipeline_.end_stream(),
        stats: (stats) => this.metrics_.server_said(stats),
        picked: ({ id, hit, distance, spread }) =>
          say({ kind: 'picked', id, hit: hit ? { distance, spread } : undefined }),
        hidden_markers: ({ id, indices }) => say({ kind: 'hidden_markers', id, indices }),
        lead: (lead) => this.led(lead),
        pinged: ({ place, byLeader }) => {
          if (place)
            say({
              kind: 'pinged',
              point: this.coordinates_.point_of(place),
              by_host: byLeader,
              name: this.host_,
            });
        },
        participants: ({ places }) =>
          say({
            kind: 'participants_moved',
            positions: places.map(this.coordinates_.point_of),
          }),
        notice: (message) => say({ kind: 'notice', message }),
        stayed: (message) => say({ kind: 'stayed', message }),
      },
      {
        sceneId: start.scene_id,
        viewportWidthPx: start.view.width_px,
        viewportHeightPx: start.view.height_px,
        decoders: available_codecs(start.rung),
        token: start.token,
        watch: start.watch,
        follow: start.watch !== '',
        device: start.device,
        settings: this.frame_sizes(),
      },
    );
  }

  private led(lead: Lead): void {
    this.host_ = lead.name;
    const { camera } = lead;
    const eye =
      camera &&
      this.coordinates_.to_file(eye_of(camera.worldFromCamera, camera.fovYRad, camera.viewHeight));
    say({ kind: 'lead', lead, eye });
  }

  private take_camera(sample: CameraSample): void {
    this.camera_ = sample;
    if (!sample.at_rest) {
      this.metrics_.pose_sent(BigInt(sample.pose_id), sample.time_us);
      if (!this.headset_) this.display_.camera = sample;
    }
    this.send_camera();
  }

  private send_camera(): void {
    const { camera_: camera } = this;
    if (!camera) return;
    const eye = this.widened(camera.eye);
    this.session_.send_pose(pose_message(camera.pose_id, camera.time_us, eye, camera.at_rest));
  }

  /** Frame sizes and fields of view change together, with the overscan. */
  private send_sizes(): void {
    this.session_.set_viewport(this.view_.width_px, this.view_.height_px);
    this.session_.send_settings(this.frame_sizes());
    this.tell_presenter();
  }

  private frame_sizes(): SettingsInit {
    if (this.headset_) return this.headset_.stream.settings;
    const { overscan, wants_depths } = this.display_;
    const sizes = frame_sizes(this.view_, this.quality_, overscan, this.presenter_.most_px);
    return { ...sizes, depths: wants_depths };
  }

  private widened(eye: Eye): Eye {
    const { headset_: headset } = this;
    if (!headset) return widened(eye, this.display_.overscan.y);
    // A server that draws both eyes needs no other, and hands on this one to followers.
    return this.shown_?.stereo ? eye : { ...eye, fov_y_rad: headset.stream.fov_y_rad };
  }

  private tell_presenter(): void {
    const { warps, overscan, warp_state } = this.display_;
    say({ kind: 'presenter', presenter: this.presenter_.kind, warp: warp_state, warps, overscan });
  }

  /** Decoders that failed are not tried again. The next stream begins with the one that worked. */
  private async make_decoder(
    config: StreamConfig,
    failures: number,
    events: DecoderEvents,
  ): Promise<MadeDecoder['decoder'] | undefined> {
    if (failures === 0) this.first_rung_ = this.rung_;
    const now_us = (): number => this.clock_.now_us();
    const made = await make_decoder(
      config,
      this.first_rung_,
      failures,
      now_us,
      browser_timers,
      events,
    );
    if (made && failures >= failures_per_rung && made.rung !== this.rung_)
      this.settle_on(made.rung);
    return made?.decoder;
  }

  private settle_on(rung: DecoderRung): void {
    this.rung_ = rung;
    say({ kind: 'rung', rung });
  }

  private fall_back(message: string): void {
    say({ kind: 'fallback', message });
    this.settle_on('jpeg');
    this.session_.greet_anew({ decoders: [Codec.MJPEG] });
  }

  private post_snapshot(request: number): void {
    const shown = this.headset_ ? undefined : this.shown_; // the canvas shows another
    const snapshot = shown && snapshot_of(this.display_, shown, this.coordinates_);
    say({ kind: 'snapshot', request, snapshot }, snapshot && [snapshot.rgba.buffer]);
  }
}
