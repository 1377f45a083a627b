// The page: puts camera, input, worker and controls together.
import { local_storage, session_storage } from '../base/browser_storage';
import { browser_timers, clock_from } from '../base/clock';
import type { Vec3 } from '../base/vector';
import { CameraController } from '../camera/camera_controller';
import { CameraLoop } from '../camera/camera_loop';
import type { Pose } from '../camera/eye';
import { Inertia } from '../camera/inertia';
import { camera_modes } from '../camera/mode';
import { is_held, sum_of, type Axes } from '../camera/movement';
import { ray_through } from '../camera/ray';
import { same_angle_rad, same_view } from '../camera/same_view';
import { remember_rung, remembered_rung } from '../decode/decoder_memory';
import { has_webcodecs } from '../decode/video_decoder';
import { Gamepads, type GamepadAction } from '../input/gamepad';
import { bind_view_input } from '../input/view_input';
import type { PresenterChoice } from '../present/make_presenter';
import { scene_setup } from '../session/camera_messages';
import { Picks } from '../session/picks';
import { QualityChoice, type View } from '../session/quality';
import { list_scenes } from '../session/scenes';
import type { SessionState } from '../session/state';
import { remember_token, take_token } from '../session/token';
import { text } from '../text';
import { Error_Code, type StreamConfig, type Welcome } from '../wire/wire';
import { WorkerClient } from '../worker/client';
import type { FromWorker } from '../worker/messages';
import { Settling, type Automation } from './automation';
import type { CardView } from './card';
import { by_id } from './dom';
import { Guide } from './guide';
import { Notice } from './notice';
import { Poster } from './poster';
import { SceneTitle } from './scene_title';
import { StatsPanel, type Facts } from './stats_panel';
import { Toolbar } from './toolbar';
import { broken_card, card_for, jpeg_reason } from './wording';

const resize_quiet_ms = 200;
const stats_interval_ms = 250;
const auto_interval_ms = 1000;
const first_card_after_ms = 300; // a fast connection shows its picture without a flash of cards

const degrees = 180 / Math.PI;

export class Viewer {
  private readonly clock_ = clock_from(performance.timeOrigin);
  private readonly camera_ = new CameraController();
  private readonly loop_: CameraLoop;
  private readonly worker_: WorkerClient;
  private readonly settling_: Settling;
  private readonly notice_ = new Notice();
  private readonly title_ = new SceneTitle();
  private readonly poster_ = new Poster();
  private readonly stats_panel_ = new StatsPanel();
  private readonly toolbar_: Toolbar;
  private readonly guide_: Guide;
  private warps_ = false;
  private overscan_ = { x: 1, y: 1 };
  private readonly view_ = by_id('view', HTMLElement);
  private readonly quality_ = new QualityChoice();
  private readonly inertia_ = new Inertia();
  private readonly rung_ = remembered_rung(local_storage(), navigator.userAgent, Date.now());
  private state_: SessionState = { phase: 'connecting', attempt: 0 };
  private facts_: Facts = { renderer: '', encoder: '', presenter: '', server_version: '' };
  private scene_ids_: readonly string[] = [];
  private broken_ = false;
  private token_ = take_token(location, history, session_storage());
  private near_z_ = 0;
  private scene_id_: string | undefined;
  private shown_: Extract<FromWorker, { kind: 'presented' }> | undefined;
  private readonly picks_ = new Picks(
    (id, ray) => this.worker_.post({ kind: 'pick', id, ray }),
    browser_timers,
  );
  private pointed_ = 0;
  private readonly reduced_motion_ = matchMedia('(prefers-reduced-motion: reduce)').matches;
  private stats_timer_: ReturnType<typeof setInterval> | undefined;

  constructor(private readonly card_: CardView) {
    const { clock_: clock } = this;
    this.settling_ = new Settling(
      () => this.shows_camera(),
      () => clock.now_us() / 1000,
      (delay_ms, action) => browser_timers.after(delay_ms, action),
    );
    this.worker_ = new WorkerClient((message) => this.heard(message));
    const { keys, pointers } = this.bind_input();
    const pads = new Gamepads({
      moved: () => {
        if (is_held(pads.axes())) this.taken_over();
      },
      action: (action) => this.act(action),
    });
    const axes = (): Axes => sum_of(keys.axes(), pads.axes());
    const is_touched = (): boolean => pointers.count > 0;
    this.loop_ = new CameraLoop(this.camera_, axes, is_touched, this.inertia_, clock, (sample) => {
      this.worker_.post({ kind: 'camera', sample });
      if (this.warps_) this.guide_.seen_from(sample.eye);
    });
    this.toolbar_ = this.make_toolbar();
    this.guide_ = this.make_guide();
    // In another page's frame: nothing but the picture, and the tour where there is one.
    document.body.classList.toggle('bare', new URLSearchParams(location.search).get('ui') === '0');
    this.toolbar_.show_fov(this.camera_.fov_y_rad * degrees);
    if (this.reduced_motion_) {
      this.camera_.smoothing_s = 0;
      this.inertia_.enabled = false;
    }
    this.start_worker();
    this.watch_page();
    window.catgs = this.automation();
    const jpeg = jpeg_reason(has_webcodecs(), isSecureContext, this.rung_);
    if (jpeg) this.notice_.show(jpeg);
  }

  retry(): void {
    this.worker_.post({ kind: 'retry' });
  }

  use_token(token: string): void {
    this.token_ = token;
    remember_token(token, session_storage());
    this.worker_.post({ kind: 'token', token });
  }

  /** For good: something broke, and the card that says so must stay. */
  break_off(message: string): void {
    this.broken_ = true;
    clearInterval(this.stats_timer_);
    this.worker_.post({ kind: 'stop' });
    this.toolbar_.set_active(false);
    this.card_.show(broken_card(message));
  }

  private start_worker(): void {
    const canvas = by_id('picture', HTMLCanvasElement).transferControlToOffscreen();
    const scene_id = new URLSearchParams(location.search).get('scene') ?? '';
    void this.poster_.show(location.href, scene_id, this.token_);
    this.worker_.post(
      {
        kind: 'start',
        canvas,
        url: location.href,
        page_origin_ms: performance.timeOrigin,
        token: this.token_,
        scene_id,
        view: this.view(),
        quality: this.quality_.in_view(this.view().height_px),
        rung: this.rung_,
        presenter: presenter_choice(),
      },
      [canvas],
    );
    setTimeout(() => this.show_state(), first_card_after_ms);
  }

  /** Size, visibility and network of the page. */
  private watch_page(): void {
    let cancel = (): void => undefined;
    new ResizeObserver(() => {
      cancel();
      cancel = browser_timers.after(resize_quiet_ms, () => this.post_view());
    }).observe(this.view_);
    document.addEventListener('visibilitychange', () => {
      this.worker_.post({ kind: 'hidden', hidden: document.hidden });
    });
    window.addEventListener('online', () => {
      if (this.state_.phase === 'waiting') this.retry();
    });
    window.addEventListener('pagehide', (event) => {
      if (!event.persisted) this.worker_.post({ kind: 'stop' });
    });
    setInterval(() => void this.look_at_height(), auto_interval_ms);
  }

  private bind_input(): ReturnType<typeof bind_view_input> {
    return bind_view_input(this.view_, this.inertia_, {
      gesture: (gesture) => {
        this.guide_.player.pause();
        this.camera_.gesture(gesture);
        this.loop_.wake();
      },
      keys_changed: () => this.taken_over(),
      let_go: () => this.loop_.wake(),
      pointed_at: (x, y) => void this.point_at(x, y),
    });
  }

  private taken_over(): void {
    this.guide_.player.pause();
    this.loop_.wake();
  }

  /** The camera turns to what is there, unless it was pointed elsewhere meanwhile. */
  private async point_at(x: number, y: number): Promise<void> {
    const { camera_: camera } = this;
    const pointed = ++this.pointed_;
    const place = await this.place_at(x, y);
    if (!place || pointed !== this.pointed_) return;
    camera.focus_on(place, this.reduced_motion_);
    this.loop_.wake();
  }

  /** Of the scene, at shares of the view's width and height. */
  private place_at(x: number, y: number): Promise<Vec3 | undefined> {
    const aspect = this.view_.clientWidth / Math.max(1, this.view_.clientHeight);
    return this.picks_.at(ray_through(this.camera_.eye, x, y, aspect));
  }

  private next_mode(): void {
    const { mode } = this.camera_;
    this.camera_.set_mode(camera_modes[(camera_modes.indexOf(mode) + 1) % camera_modes.length]!);
    this.toolbar_.show_mode(this.camera_.mode);
  }

  private act(action: GamepadAction): void {
    switch (action) {
      case 'mode':
        this.next_mode();
        break;
      case 'reset':
        this.camera_.reset();
        this.camera_moved();
        break;
      default:
        this.guide_.act(action);
    }
  }

  private make_guide(): Guide {
    return new Guide({
      camera: this.camera_,
      loop: this.loop_,
      worker: this.worker_,
      clock: this.clock_,
      view: this.view_,
      reduced_motion: this.reduced_motion_,
      place_ahead: () => this.place_at(0.5, 0.5),
      camera_moved: () => this.camera_moved(),
      mode_changed: () => this.toolbar_.show_mode(this.camera_.mode),
      show_author: () => this.toolbar_.open('author'),
      make_room: () => this.toolbar_.make_room(),
      notice: (message) => this.notice_.show(message),
    });
  }

  private make_toolbar(): Toolbar {
    return new Toolbar({
      toggle_mode: () => {
        this.next_mode();
      },
      reset: () => {
        this.camera_.reset();
        this.camera_moved();
      },
      flip_up: () => {
        this.camera_.flip_up();
        this.camera_moved();
      },
      share_shown: () => this.guide_.share_shown(),
      stats_shown: (shown) => {
        clearInterval(this.stats_timer_);
        if (!shown) return;
        const show = (): void =>
          void this.worker_.stats().then((stats) => this.stats_panel_.show(stats));
        show();
        this.stats_timer_ = setInterval(show, stats_interval_ms);
      },
      quality: (size, max_fps) => {
        this.quality_.choose(size, max_fps);
        this.post_view();
      },
      warp: (mode) => this.worker_.post({ kind: 'warp', mode }),
      fov_y_deg: (value) => {
        this.camera_.fov_y_rad = value / degrees;
        this.camera_moved();
      },
    });
  }

  private camera_moved(): void {
    this.toolbar_.show_fov(this.camera_.fov_y_rad * degrees);
    this.loop_.changed();
  }

  private heard(message: Parameters<ConstructorParameters<typeof WorkerClient>[0]>[0]): void {
    switch (message.kind) {
      case 'state':
        this.state_ = message.state;
        if (message.state.phase !== 'connecting' || message.state.attempt > 0) this.show_state();
        if (message.state.phase === 'failed' && message.state.code === Error_Code.UNKNOWN_SCENE) {
          void this.offer_scenes();
        }
        break;
      case 'welcome':
        this.welcome(message.welcome);
        break;
      case 'config':
        this.configured(message.config);
        break;
      case 'presented':
        this.presented(message);
        break;
      case 'presenter':
        this.show_facts({ presenter: message.description });
        this.warps_ = message.warps;
        // The newest picture has another field of view: a sample makes the server draw it anew.
        if (message.overscan.y !== this.overscan_.y || message.overscan.x !== this.overscan_.x) {
          this.loop_.changed();
        }
        this.overscan_ = message.overscan;
        break;
      case 'rung':
        remember_rung(message.rung, local_storage(), navigator.userAgent, Date.now());
        break;
      case 'picked':
        this.picks_.answered(message.id, message.distance);
        break;
      case 'notice':
        this.notice_.show(message.message, true);
        break;
      case 'fallback':
        this.notice_.show(text.jpeg.failed_now(message.message));
        break;
      case 'broken':
        this.break_off(message.message);
        break;
    }
  }

  private show_state(): void {
    if (this.broken_) return;
    const has_picture = this.shown_ !== undefined;
    this.card_.show(card_for(this.state_, has_picture, this.scene_ids_));
    this.toolbar_.set_active(this.state_.phase !== 'failed');
    document.body.classList.toggle('stale', has_picture && this.state_.phase !== 'live');
  }

  /** Without a welcome nobody has said which scenes there are. */
  private async offer_scenes(): Promise<void> {
    this.scene_ids_ = await list_scenes(location.href, this.token_);
    this.show_state();
  }

  private welcome(welcome: Welcome): void {
    this.show_facts({ renderer: welcome.renderer, server_version: welcome.serverVersion });
    const { scene } = welcome;
    // After a reconnect the visitor stays where they were.
    if (!scene || scene.sceneId === this.scene_id_) return;
    this.scene_id_ = scene.sceneId;
    this.near_z_ = scene.nearZ;
    this.title_.show(scene, welcome.sceneIds);
    this.camera_.load(scene_setup(scene));
    this.loop_.enable();
    void this.guide_.enter(scene.sceneId, this.token_);
  }

  private configured(config: StreamConfig): void {
    this.show_facts({ encoder: config.encoder });
  }

  private presented(message: Extract<FromWorker, { kind: 'presented' }>): void {
    const is_first = this.shown_ === undefined;
    this.shown_ = message;
    this.settling_.presented();
    this.poster_.end();
    if (!this.warps_ || is_first) {
      this.guide_.seen_from({ ...message.pose, fov_y_rad: message.fov_y_rad });
    }
    if (is_first) this.show_state();
  }

  /**
   * The server renders nothing anew for a pose that shows the same picture, so that its number may
   * never come back.
   */
  private shows_camera(): boolean {
    const { shown_: shown, camera_: camera } = this;
    if (!shown || this.loop_.pending) return false;
    if (shown.pose_id >= this.loop_.pose_id) return true;
    return (
      Math.abs(shown.fov_y_rad - camera.fov_y_rad) < same_angle_rad &&
      same_view(shown.pose, camera.pose, this.near_z_)
    );
  }

  private show_facts(facts: Partial<Facts>): void {
    this.facts_ = { ...this.facts_, ...facts };
    this.stats_panel_.show_facts(this.facts_);
  }

  private async look_at_height(): Promise<void> {
    if (!this.quality_.is_automatic || this.state_.phase !== 'live') return;
    const { stages_ms } = await this.worker_.stats();
    const frame_ms = stages_ms.render + stages_ms.encode;
    if (this.quality_.look(frame_ms, this.view().height_px)) this.post_view();
  }

  private post_view(): void {
    const quality = this.quality_.in_view(this.view().height_px);
    this.worker_.post({ kind: 'view', view: this.view(), quality });
  }

  private view(): View {
    const ratio = window.devicePixelRatio;
    return {
      width_px: Math.max(16, Math.round(this.view_.clientWidth * ratio)),
      height_px: Math.max(16, Math.round(this.view_.clientHeight * ratio)),
    };
  }

  private automation(): Automation {
    return {
      setPose: (pose: Pose, fov_y_rad?: number) => {
        this.camera_.jump(pose);
        if (fov_y_rad !== undefined) this.camera_.fov_y_rad = fov_y_rad;
        this.toolbar_.show_fov(this.camera_.fov_y_rad * degrees);
        this.loop_.sample();
      },
      pose: () => this.camera_.pose,
      settled: () => this.settling_.wait(),
      snapshot: async () => {
        const snapshot = await this.worker_.snapshot();
        if (!snapshot) throw new Error('no picture has been shown yet');
        return snapshot;
      },
      stats: () => this.worker_.stats(),
    };
  }
}

/** `?presenter=webgl2` and `?presenter=2d` override the choice by what the GPU can do. */
function presenter_choice(): PresenterChoice {
  const wanted = new URLSearchParams(location.search).get('presenter');
  return wanted === 'webgl2' || wanted === '2d' ? wanted : 'auto';
}
