// Everything that leads through a scene: tours, shared views, the page around this one.
import { browser_timers, type Clock } from '../base/clock';
import type { Vec3 } from '../base/vector';
import type { CameraController } from '../camera/camera_controller';
import type { CameraLoop } from '../camera/camera_loop';
import type { Eye } from '../camera/eye';
import type { GamepadAction } from '../input/gamepad';
import { text } from '../text';
import { fetch_tours, read_document } from '../tour/load';
import { TourPlayer, type TourState } from '../tour/player';
import { read_shared, share_address } from '../tour/share';
import type { WorkerClient } from '../worker/client';
import { AuthorPanel } from './author_panel';
import { EmbedApi } from './embed';
import { SharePanel } from './share_panel';
import { TourView } from './tour_view';

export interface GuideParts {
  readonly camera: CameraController;
  readonly loop: CameraLoop;
  readonly worker: WorkerClient;
  readonly clock: Clock;
  readonly view: HTMLElement;
  readonly reduced_motion: boolean;
  /** What is in the middle of the view. */
  place_ahead(): Promise<Vec3 | undefined>;
  /** The camera was put somewhere else. */
  camera_moved(): void;
  mode_changed(): void;
  /** Opens the panel in which tours are made. */
  show_author(): void;
  /** Closes panels where they would hide the picture. */
  make_room(): void;
  notice(message: string): void;
}

export class Guide {
  readonly player: TourPlayer;
  readonly tour_view = new TourView();
  private readonly share_: SharePanel;
  private readonly embed_: EmbedApi;
  private readonly author_: AuthorPanel | undefined;
  private scene_id_ = '';
  private has_token_ = false;
  private loads_ = 0;

  constructor(private readonly parts_: GuideParts) {
    const { camera, loop, worker, clock, reduced_motion } = parts_;
    this.player = new TourPlayer(
      {
        camera: {
          get eye() {
            return camera.eye;
          },
          get reach() {
            return camera.reach;
          },
          fly: (way, ended) => {
            camera.fly(way, ended);
            loop.wake();
          },
          stop_flight: () => camera.stop_flight(),
        },
        timers: browser_timers,
        now_us: () => clock.now_us(),
        announce: (samples) => worker.post({ kind: 'path', samples }),
        reduced_motion,
      },
      (state) => this.tour_changed(state),
    );
    this.tour_view.bind(this.player);
    this.share_ = new SharePanel({
      address: () => this.address(),
      snapshot: () => worker.snapshot(),
      name: () => this.scene_id_ || 'scene',
      has_token: () => this.has_token_,
    });
    this.embed_ = new EmbedApi({
      eye: () => camera.eye,
      set_eye: (eye) => this.put(eye),
      go_to: (stop) => this.player.go_to(stop),
      next: () => this.player.next(),
      previous: () => this.player.previous(),
      play: () => this.player.play(),
      pause: () => this.player.pause(),
      reset: () => {
        camera.reset();
        parts_.camera_moved();
      },
    });
    this.author_ = new URLSearchParams(location.search).has('author')
      ? this.make_author()
      : undefined;
    window.addEventListener('hashchange', () => this.apply_shared());
  }

  private make_author(): AuthorPanel {
    const { camera } = this.parts_;
    return new AuthorPanel({
      eye: () => camera.eye,
      scene: () => camera.scene,
      scene_id: () => this.scene_id_ || 'scene',
      place_ahead: () => this.parts_.place_ahead(),
      changed: (tours) => {
        this.tour_view.show_tours(tours);
        this.player.load(tours.map((tour) => ({ ...tour, starts_itself: false })));
      },
      go_to: (stop_index) => {
        this.player.choose(0);
        this.player.go_to(stop_index);
      },
      preview: () => {
        this.parts_.make_room();
        this.player.choose(0);
        this.player.leave();
        this.player.play();
      },
      start_at: (eye) => camera.start_at(eye),
    });
  }

  share_shown(): void {
    this.share_.shown();
  }

  /** The scene has told where its camera starts: its tours come, and a shared view is taken. */
  async enter(scene_id: string, token: string): Promise<void> {
    this.scene_id_ = scene_id;
    this.has_token_ = token !== '';
    const load = ++this.loads_;
    const shared = read_shared(location.href);
    if (shared.eye) this.apply_shared();
    const { document, may_save } = await fetch_tours(location.href, token, scene_id);
    if (load !== this.loads_) return; // another scene was entered meanwhile
    const { camera, view } = this.parts_;
    const aspect = view.clientWidth / Math.max(1, view.clientHeight);
    const { tours, start, problems } = read_document(
      document,
      camera.up,
      camera.fov_y_rad,
      aspect,
    );
    for (const problem of problems) this.parts_.notice(text.tour.unreadable(problem));
    if (start) {
      camera.start_at(start);
      if (!shared.eye) this.put(start);
    }
    this.tour_view.show_tours(tours);
    this.author_?.load(tours, may_save ? token : undefined, document.etag);
    // A link to a view or a stop is not led away from there, and neither is an author.
    const stays =
      shared.eye !== undefined || shared.stop_index !== undefined || this.author_ !== undefined;
    this.player.load(
      stays ? tours.map((tour) => ({ ...tour, starts_itself: false })) : tours,
    );
    if (load === 1 && this.author_) this.parts_.show_author();
    if (shared.tour_index !== undefined) this.player.choose(shared.tour_index);
    if (shared.stop_index !== undefined && !shared.eye) this.player.go_to(shared.stop_index, true);
    this.embed_.say({
      catgs: 'ready',
      scene: scene_id,
      stops: (tours[0]?.stops ?? []).map(({ title }) => title),
    });
  }

  act(action: Exclude<GamepadAction, 'mode' | 'reset'>): void {
    if (action === 'next') this.player.next();
    else if (action === 'previous') this.player.previous();
    else this.player.toggle();
  }

  /** Where the scene is seen from, on the canvas. */
  seen_from(eye: Eye): void {
    const { clientWidth, clientHeight } = this.parts_.view;
    this.tour_view.place(eye, clientWidth, clientHeight);
  }

  private address(): string {
    const { camera } = this.parts_;
    const { tour_index, stop_index } = this.player.state;
    return share_address(location.href, this.scene_id_, {
      eye: camera.eye,
      mode: camera.mode,
      tour_index,
      stop_index,
    });
  }

  private apply_shared(): void {
    const { eye, mode, stop_index } = read_shared(location.href);
    if (mode) {
      this.parts_.camera.set_mode(mode);
      this.parts_.mode_changed();
    }
    if (eye) this.put(eye);
    else if (stop_index !== undefined) this.player.go_to(stop_index);
  }

  private put(eye: Eye): void {
    const { camera } = this.parts_;
    camera.jump(eye);
    camera.fov_y_rad = eye.fov_y_rad;
    this.parts_.camera_moved();
  }

  private tour_changed(state: TourState): void {
    this.tour_view.show(state);
    this.seen_from(this.parts_.camera.eye);
    this.embed_.say({
      catgs: 'stop',
      stop: state.stop_index ?? null,
      playing: state.playing,
    });
  }
}
