// The life of a session: hello, welcome, frames, heartbeat, errors, drain, reconnect. It uses neither
// WebSocket nor the wall clock, so that tests can drive it with fakes.
import type { Clock, Timers } from '../base/clock';
import type { OpenSocket } from '../transport/socket';
import {
  Error_Code,
  wire_version,
  type ClientBody,
  type Company,
  type FrameHeader,
  type HiddenMarkers,
  type HelloInit,
  type Lead,
  type Picked,
  type Pinged,
  type PoseInit,
  type ServerBody,
  type Incoming,
  type SettingsInit,
  type Stats,
  type StreamConfig,
  type Welcome,
  type Error as ServerError,
} from '../wire/wire';
import { backoff_ms } from './backoff';
import { Link } from './link';
import type { SessionState, WaitCause } from './state';

/** The fields of hello that the session does not know itself. */
type Greeting = Omit<HelloInit, '$typeName' | 'version' | 'resume'>;

interface SessionListener {
  state(state: SessionState): void;
  welcome(welcome: Welcome): void;
  /** Comes before the first frame that it describes. That frame is an IDR. */
  config(config: StreamConfig): void;
  frame(header: FrameHeader, payload: Uint8Array): void;
  /** The connection of the frames so far is about to close. Acknowledge them now or never. */
  stream_ended(): void;
  stats(stats: Stats): void;
  picked(picked: Picked): void;
  hidden_markers(hidden: HiddenMarkers): void;
  /** Of the presentation that this session gives, watches or follows. */
  lead(lead: Lead): void;
  pinged(pinged: Pinged): void;
  /** Where all in the shared tour are. */
  participants(company: Company): void;
  /** The server sent a message for people. The session continues. */
  notice(message: string): void;
  /** The selected scene cannot be entered: the server says why. The session continues where it was. */
  stayed(message: string): void;
}

interface SessionEnvironment {
  open: OpenSocket;
  clock: Clock;
  timers: Timers;
  random: () => number;
}

const stable_ms = 5000; // after a connection that lived this long, backoff starts anew
const tries_to_go_along = 3; // for about a second: a host's page presents again when it is in its new scene
const longest_update_us = 300e6; // after that, a server that is away is not called updated any more
const keep_alive_ms = 10_000;
const congested_bytes = 32 * 1024;
const congestion_poll_ms = 20;

export class Session {
  /** A drain has two links: the old one shows pictures until the successor can. */
  private link_: Link | undefined;
  private successor_: Link | undefined;
  private successor_attempt_ = 0;
  private attempt_ = 0;
  private cancel_retry_: () => void = () => undefined;
  private cancel_successor_: () => void = () => undefined;
  private cancel_pose_: () => void = () => undefined;
  private cancel_keep_alive_: () => void = () => undefined;
  private resume_token_ = '';
  private last_pose_: PoseInit | undefined;
  private path_: readonly PoseInit[] = [];
  private update_until_us_ = 0; // what happens to connections until then belongs to an update
  private paused_ = false;
  private left_scene_: string | undefined; // as the greeting named it; until the selected one is there
  private readonly kept_ = new Map<ClientBody['case'], ClientBody>();

  constructor(
    private readonly env_: SessionEnvironment,
    private readonly listener_: SessionListener,
    private greeting_: Greeting,
  ) {}

  start(): void {
    this.connect();
  }

  /** Connects at once and stops waiting. */
  retry(): void {
    this.attempt_ = 0;
    this.connect();
  }

  /** Opens a new connection with other decoders, another token or another scene. */
  greet_anew(change: Partial<Greeting>): void {
    this.greeting_ = { ...this.greeting_, ...change };
    if (change.watch !== undefined) this.forget_scene(); // the host may be in another one
    this.retry();
  }

  /** Sends to a server that has welcomed this session. Nothing is kept for later. */
  send(body: ClientBody): void {
    if (this.link_?.welcome) this.link_.send(body);
  }

  /** Sends it, and again at each welcome. A newer message of its kind takes its place. */
  keep(body: ClientBody): void {
    this.kept_.set(body.case, body);
    if (this.link_?.welcome?.watching === false) this.send(body);
  }

  /** The newest pose wins. A congested connection skips older ones. */
  send_pose(pose: PoseInit): void {
    this.last_pose_ = pose;
    this.flush_pose();
  }

  send_settings(settings: SettingsInit): void {
    this.greeting_ = { ...this.greeting_, settings };
    this.send({ case: 'settings', value: settings });
  }

  /** Goes to another scene. A welcome follows, or `stayed`. */
  select_scene(scene_id: string): void {
    this.left_scene_ ??= this.greeting_.sceneId ?? '';
    this.greeting_ = { ...this.greeting_, sceneId: scene_id };
    this.forget_scene();
    this.send({ case: 'selectScene', value: { sceneId: scene_id } });
  }

  /** Tells where the camera will go, for the forecasts of the server. */
  send_path(samples: PoseInit[]): void {
    this.path_ = samples;
    this.send({ case: 'path', value: { samples } });
  }

  set_viewport(width_px: number, height_px: number): void {
    this.greeting_ = { ...this.greeting_, viewportWidthPx: width_px, viewportHeightPx: height_px };
  }

  /** A hidden page needs no pictures. */
  set_paused(paused: boolean): void {
    if (paused === this.paused_) return;
    this.paused_ = paused;
    this.send({ case: 'pause', value: { paused } });
  }

  /** Says good-bye, also in a queue and to the server that takes over. retry() continues where the visitor was. */
  stop(): void {
    for (const link of [this.link_, this.successor_]) link?.send({ case: 'bye', value: {} });
    this.drop_links();
  }

  /** What was sent of this scene means nothing in another. */
  private forget_scene(): void {
    this.last_pose_ = undefined;
    this.path_ = [];
    for (const kind of ['clip', 'markers', 'show'] as const) this.kept_.delete(kind);
  }

  private connect(): void {
    this.drop_links();
    this.listener_.state({ phase: 'connecting', attempt: this.attempt_ });
    this.link_ = this.open_link();
  }

  private drop_links(): void {
    this.cancel_retry_();
    this.cancel_successor_();
    this.cancel_pose_();
    this.cancel_keep_alive_();
    if (this.link_?.welcome) this.listener_.stream_ended();
    this.link_?.close();
    this.successor_?.close();
    this.link_ = this.successor_ = undefined;
  }

  private open_link(): Link {
    const link: Link = new Link(this.env_, () => this.hello(), {
      heard: (incoming) => this.heard(link, incoming),
      lost: (cause, message) => this.lost(link, cause, message),
    });
    return link;
  }

  private hello(): HelloInit {
    return {
      ...this.greeting_,
      version: wire_version,
      ...(this.resume_token_ && {
        resume: {
          token: this.resume_token_,
          ...(this.last_pose_ && { pose: this.last_pose_ }),
          ...path_ahead(this.path_, this.env_.clock.now_us()),
        },
      }),
    };
  }

  private lost(link: Link, cause: WaitCause, message: string): void {
    link.close();
    if (cause === 'updating') this.expect_update();
    if (link === this.successor_) {
      this.successor_ = undefined;
      this.open_successor_later();
    } else if (link === this.link_) {
      if (this.successor_) {
        this.succeed(this.successor_);
        return;
      }
      const lived_ms = link.welcome ? (this.env_.clock.now_us() - link.welcomed_us) / 1000 : 0;
      if (lived_ms >= stable_ms) this.attempt_ = 0;
      const updating = cause !== 'refused' && this.env_.clock.now_us() < this.update_until_us_;
      this.wait(updating ? 'updating' : cause, updating ? '' : message);
    }
  }

  private expect_update(): void {
    this.update_until_us_ = this.env_.clock.now_us() + longest_update_us;
  }

  private wait(cause: WaitCause, message: string): void {
    this.drop_links();
    this.attempt_ += 1;
    const retry_in_ms = backoff_ms(this.attempt_, this.env_.random);
    this.listener_.state({ phase: 'waiting', cause, retry_in_ms, message });
    this.cancel_retry_ = this.env_.timers.after(retry_in_ms, () => this.connect());
  }

  private heard(link: Link, incoming: Incoming): void {
    if (incoming.kind === 'frame') {
      if (link === this.successor_) this.succeed(link);
      this.listener_.frame(incoming.header, incoming.payload);
    } else if (incoming.kind === 'message') {
      this.handle(link, incoming.body);
    }
  }

  private handle(link: Link, body: ServerBody): void {
    switch (body.case) {
      case 'welcome':
        this.welcomed(link, body.value);
        break;
      case 'config':
        link.config = body.value;
        if (link === this.link_) this.listener_.config(body.value);
        break;
      case 'queue':
        if (link === this.link_) {
          const { position, estimateS, forScene } = body.value;
          this.listener_.state({
            phase: 'queued',
            position,
            estimate_s: estimateS,
            for_scene: forScene,
          });
        }
        break;
      case 'stats':
        if (link === this.link_) this.listener_.stats(body.value);
        break;
      case 'picked':
        if (link === this.link_) this.listener_.picked(body.value);
        break;
      case 'hiddenMarkers':
        if (link === this.link_) this.listener_.hidden_markers(body.value);
        break;
      case 'lead':
        if (link === this.link_) this.listener_.lead(body.value);
        break;
      case 'pinged':
        if (link === this.link_) this.listener_.pinged(body.value);
        break;
      case 'company':
        if (link === this.link_) this.listener_.participants(body.value);
        break;
      case 'error':
        this.refused(link, body.value);
        break;
      case 'drain':
        this.expect_update();
        if (link === this.link_ && !this.successor_) this.successor_ = this.open_link();
        break;
      case 'heartbeat':
        break;
    }
  }

  private welcomed(link: Link, welcome: Welcome): void {
    link.welcome = welcome;
    link.welcomed_us = this.env_.clock.now_us();
    this.update_until_us_ = 0;
    if (welcome.config) link.config = welcome.config;
    if (welcome.resumeToken) this.resume_token_ = welcome.resumeToken;
    this.led(welcome);
    this.left_scene_ = undefined;
    if (link === this.link_) this.go_live(link);
    else if (this.last_pose_) link.send({ case: 'pose', value: this.last_pose_ });
  }

  /** The host's scene is that of a session of its own, now or when it leaves. Such a session stays one. */
  private led({ watching, mayLeave, scene }: Welcome): void {
    if (!this.greeting_.watch || (watching && !mayLeave)) return;
    this.greeting_ = { ...this.greeting_, sceneId: scene?.sceneId ?? '' };
    if (!watching) this.greeting_ = { ...this.greeting_, watch: '', follow: false };
  }

  /** Takes over: the successor has its first picture, or the old connection is gone. */
  private succeed(link: Link): void {
    this.listener_.stream_ended();
    if (this.link_) {
      this.link_.send({ case: 'bye', value: {} });
      this.link_.close();
    }
    this.link_ = link;
    this.successor_ = undefined;
    this.successor_attempt_ = 0;
    if (link.welcome) this.go_live(link);
    else this.listener_.state({ phase: 'connecting', attempt: this.attempt_ });
  }

  private go_live(link: Link): void {
    if (link.welcome) this.listener_.welcome(link.welcome);
    if (link.config) this.listener_.config(link.config);
    this.listener_.state({ phase: 'live' });
    if (this.paused_) this.send({ case: 'pause', value: { paused: true } });
    if (!link.welcome?.watching) for (const body of this.kept_.values()) this.send(body);
    this.flush_pose();
    this.keep_alive();
  }

  private refused(link: Link, error: ServerError): void {
    if (!error.fatal && this.left_scene_ !== undefined && shuts_out(error.code)) {
      this.greeting_ = { ...this.greeting_, sceneId: this.left_scene_ };
      this.left_scene_ = undefined;
      this.listener_.stayed(error.message);
    } else if (!error.fatal) {
      this.listener_.notice(error.message);
    } else if (link === this.successor_) {
      this.lost(link, 'refused', error.message);
    } else if (this.goes_along_in_vain(link, error.code)) {
      this.listener_.notice(error.message);
      this.kept_.delete('follow'); // until the visitor asks for it again
      this.greet_anew({ watch: '', follow: false });
    } else if (lacks_host(error.code)) {
      if (link.welcome) this.attempt_ = 0; // the host presented until now, and may have gone to another scene
      this.wait('no_host', error.message);
    } else if (is_temporary(error.code)) {
      this.wait('refused', error.message);
    } else {
      this.drop_links();
      this.resume_token_ = '';
      this.listener_.state({ phase: 'failed', code: error.code, message: error.message });
    }
  }

  /** Whether it is time to return to the session that the visitor had before. */
  private goes_along_in_vain(link: Link, code: Error_Code): boolean {
    if (!this.greeting_.watch || !this.resume_token_ || link.welcome) return false;
    return this.attempt_ + 1 >= tries_to_go_along || !(lacks_host(code) || is_temporary(code));
  }

  /** Tries less and less often, because a fleet of one server refuses until it has ended. */
  private open_successor_later(): void {
    this.successor_attempt_ += 1;
    const retry_in_ms = backoff_ms(this.successor_attempt_, this.env_.random);
    this.cancel_successor_ = this.env_.timers.after(retry_in_ms, () => {
      if (this.link_ && !this.successor_) this.successor_ = this.open_link();
    });
  }

  private flush_pose(): void {
    this.cancel_pose_();
    if (!this.last_pose_ || this.link_?.welcome?.watching !== false) return;
    if (this.link_.buffered_bytes() > congested_bytes) {
      this.cancel_pose_ = this.env_.timers.after(congestion_poll_ms, () => this.flush_pose());
      return;
    }
    this.send({ case: 'pose', value: this.last_pose_ });
  }

  /**
   * Keeps proxies from closing a connection on which nothing moves. The server does not count the
   * repeated pose as activity: it warns the visitor and then gives the slot to others.
   */
  private keep_alive(): void {
    this.cancel_keep_alive_();
    this.cancel_keep_alive_ = this.env_.timers.after(keep_alive_ms, () => {
      if (!this.paused_) this.flush_pose();
      this.keep_alive();
    });
  }
}

/** The rest of the path, so that any server can go on forecasting by it. */
function path_ahead(path: readonly PoseInit[], now_us: number): { path?: { samples: PoseInit[] } } {
  const next = path.findIndex(({ clientTimeUs }) => Number(clientTimeUs ?? 0n) > now_us);
  return next < 0 ? {} : { path: { samples: path.slice(Math.max(0, next - 1)) } };
}

/** Whether an error refuses a scene. */
const shuts_out = (code: Error_Code): boolean =>
  code === Error_Code.UNKNOWN_SCENE ||
  code === Error_Code.UNAUTHORIZED ||
  code === Error_Code.SERVER_FULL;

/** Whether there was nobody to watch. */
const lacks_host = (code: Error_Code): boolean =>
  code === Error_Code.SESSION_ENDED || code === Error_Code.NO_LEADER;

/** Whether time may cure a refusal. All others need another link, token, scene or program. */
function is_temporary(code: Error_Code): boolean {
  return (
    code === Error_Code.SERVER_FULL ||
    code === Error_Code.RATE_LIMITED ||
    code === Error_Code.INTERNAL
  );
}
