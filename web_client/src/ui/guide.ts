// Leads visitors through a scene: tours, shared views, and the page around this one.
import { browser_timers, type Clock } from '../base/clock';
import { Signal } from '../base/signal';
import type { Eye } from '../camera/eye';
import { start_mode } from '../session/camera_messages';
import { scene_name } from '../session/scenes';
import type { AccessToken } from '../session/token';
import { readers, text } from '../text/text';
import { fetch_tours, read_document } from '../tour/load';
import type { SceneAbout } from '../tour/draft';
import { max_stops, max_tours } from '../tour/limits';
import { TourPlayer, type TourState } from '../tour/player';
import { read_shared, share_address, type SharedView } from '../tour/share';
import { tours_for, type Tour } from '../tour/tour';
import type { SceneFacts } from '../wire/wire';
import type { WorkerClient } from '../worker/client';
import { AuthorPanel } from './author_panel';
import type { MediaFields } from './author_stops';
import { Doors } from './doors';
import { EmbedApi } from './embed';
import { Hotspots } from './hotspots';
import type { Navigation } from './navigation';
import type { Notice } from './notice';
import { Preview } from './preview';
import { css_colour } from './scene_title';
import type { SeenCamera } from './seen_camera';
import { SharePanel } from './share_panel';
import type { Toolbar } from './toolbar';
import { TourView } from './tour_view';

/** The parts of the page that its larger features share. */
export interface PageParts {
  readonly view: HTMLElement;
  readonly clock: Clock;
  readonly worker: WorkerClient;
  readonly navigation: Navigation;
  readonly seen: SeenCamera;
  readonly toolbar: Toolbar;
  readonly token: AccessToken;
  readonly reduced_motion: boolean;
}

interface GuideParts extends PageParts {
  readonly notice: Notice;
  readonly media: GuideMedia;
  readonly media_fields: MediaFields;
}

/** Shows and plays what stops have besides words (media/). */
export interface GuideMedia {
  show_tours(scene_id: string, tours: readonly Tour[]): void;
  show(state: TourState): void;
  /** The visitor has come to the stop that is shown. */
  arrived(): void;
  /** See TourEnvironment. */
  when_heard(then: () => void): () => void;
}

export class Guide {
  /** The tour or its stop has changed. */
  readonly tour_shown = new Signal<TourState>();
  private readonly player_: TourPlayer;
  private readonly doors_: Doors;
  private readonly tour_view_: TourView;
  private readonly hotspots_: Hotspots;
  private readonly embed_: EmbedApi;
  private readonly author_: AuthorPanel | undefined;
  private loads_ = 0;
  private first_start_: Eye | undefined; // of the scene, as visitors get it

  constructor(private readonly parts_: GuideParts) {
    const { view, clock, worker, navigation, reduced_motion } = parts_;
    this.player_ = new TourPlayer(
      {
        camera: navigation,
        timers: browser_timers,
        now_us: () => clock.now_us(),
        announce: (samples) => worker.post({ kind: 'path', samples }),
        reached: (tour, stop) => {
          // Imported tours may be longer than those that the wire can tell of.
          if (tour < max_tours && stop < max_stops) worker.post({ kind: 'reached', tour, stop });
          parts_.media.arrived();
        },
        when_heard: (then) => parts_.media.when_heard(then),
        reduced_motion,
      },
      (state) => this.tour_changed(state),
    );
    this.doors_ = new Doors(parts_, () => this.view);
    this.tour_view_ = new TourView(this.player_, this.doors_);
    this.hotspots_ = new Hotspots(view, parts_.seen, this.doors_, (stop) => this.player_.go_to(stop));
    this.embed_ = this.make_embed();
    const is_author = new URLSearchParams(location.search).has('author');
    this.author_ = is_author ? this.make_author() : undefined;
    this.bind_share();
    navigation.entered.listen(({ scene }) => void this.enter(scene));
    navigation.up_changed.listen(() => this.author_?.scene_changed());
    navigation.taken_over.listen(() => this.player_.pause());
    navigation.went_back.listen(() => this.player_.leave()); // what is shown is no stop any more
    navigation.pad_pressed.listen((action) => {
      if (action === 'next') this.player_.next();
      else if (action === 'previous') this.player_.previous();
      else if (action === 'play') this.player_.toggle();
    });
    window.addEventListener('hashchange', () => {
      if (this.doors_.leads_elsewhere) return;
      const shared = read_shared(location.href);
      this.show_view(shared);
      this.show_stop(shared);
    });
  }

  pause(): void {
    this.player_.pause();
  }

  go_to_stop(index: number): void {
    this.player_.go_to(index);
  }

  /** Of authors: the scene has this scale from now on. Undefined for visitors. */
  get set_scale(): ((metres_per_unit: number) => void) | undefined {
    const { author_: author } = this;
    return author && ((metres_per_unit) => author.edit_about({ metres_per_unit }));
  }

  private make_embed(): EmbedApi {
    const { navigation } = this.parts_;
    return new EmbedApi({
      eye: () => navigation.eye,
      set_eye: (eye) => this.put(eye),
      go_to: (stop) => this.player_.go_to(stop),
      next: () => this.player_.next(),
      previous: () => this.player_.previous(),
      play: () => this.player_.play(),
      pause: () => this.player_.pause(),
      reset: () => navigation.reset(),
    });
  }

  private make_author(): AuthorPanel {
    const { navigation, toolbar } = this.parts_;
    const { camera } = navigation;
    const preview = new Preview(this.player_, toolbar, () => navigation.eye, (eye) => navigation.put_back(eye));
    navigation.taken_over.listen(() => preview.forget());
    return new AuthorPanel({
      eye: () => camera.eye,
      reach: () => navigation.reach,
      scene: () => camera.scene,
      scene_id: () => navigation.scene_id,
      scenes: () => this.doors_.scenes(),
      file_name: () => this.file_name(),
      place_ahead: () => navigation.place_ahead(),
      changed: (tours, edited) => {
        preview.forget();
        this.show_tours(tours);
        this.player_.load(tours, true);
        this.player_.choose(edited);
      },
      go_to: (stop_index) => this.player_.go_to(stop_index),
      preview: () => preview.begin(),
      media: this.parts_.media_fields,
      start_at: (eye) => camera.start_at(eye ?? this.first_start_),
    });
  }

  private bind_share(): void {
    const { worker, toolbar, token } = this.parts_;
    const share = new SharePanel({
      address: () => this.address(),
      snapshot: () => worker.snapshot(),
      name: () => this.file_name(),
      has_token: () => token.value !== '',
    });
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'share' && shown) share.shown();
    });
  }

  /** A scene was entered: takes the shared view of the address and loads the tours. */
  private async enter(scene: SceneFacts): Promise<void> {
    const scene_id = scene.sceneId;
    const { navigation, view, notice, toolbar } = this.parts_;
    const token = this.parts_.token.value;
    const load = ++this.loads_;
    const shared = this.doors_.arrive(scene_id) ?? read_shared(location.href);
    this.show_view(shared);
    const { document, may_save } = await fetch_tours(location.href, token, scene_id);
    if (load !== this.loads_) return; // the visitor entered another scene meanwhile
    const { camera } = navigation;
    const aspect = view.clientWidth / Math.max(1, view.clientHeight);
    const { tours, start, problems } = read_document(document, camera.up, camera.fov_y_rad, aspect);
    await this.doors_.learn(tours);
    if (load !== this.loads_) return;
    for (const problem of problems) notice.show(text.tour.unreadable({ why: problem }));
    if (start) {
      camera.start_at(start);
      if (!shared.eye && !navigation.led) navigation.reset();
    }
    this.first_start_ = camera.start;
    // Authors see each text in the language that they edit.
    const shown = tours_for(tours, this.author_ ? [] : readers);
    this.show_tours(shown);
    this.author_?.load(tours, about_of(scene), may_save ? token : undefined, document.etag);
    // No tour starts by itself for an author, or for a visitor whose link leads to a view or a stop.
    const stays = shared.eye !== undefined || shared.stop_index !== undefined || this.author_ !== undefined || navigation.led;
    this.player_.load(shown, stays);
    if (load === 1 && this.author_) toolbar.open('author');
    this.show_stop(shared, true);
    this.doors_.arrived();
    this.embed_.say({
      catgs: 'ready',
      scene: scene_name(scene_id),
      stops: (shown[0]?.stops ?? []).map(({ title }) => title),
    });
  }

  private show_view({ eye, mode }: SharedView): void {
    if (mode) this.parts_.navigation.set_mode(mode);
    if (!eye) return;
    this.player_.pause();
    this.put(eye);
  }

  private show_stop({ eye, tour_index, stop_index }: SharedView, at_once?: boolean): void {
    if (tour_index !== undefined) this.player_.choose(tour_index);
    if (stop_index === undefined) return;
    if (eye) this.player_.show_stop(stop_index);
    else this.player_.go_to(stop_index, at_once);
  }

  private put(eye: Eye): void {
    if (!this.parts_.navigation.put(eye)) this.parts_.notice.show(text.share.outside, 10);
  }

  private show_tours(tours: readonly Tour[]): void {
    this.tour_view_.show_tours(tours);
    this.parts_.media.show_tours(this.parts_.navigation.scene_id, tours);
  }

  private tour_changed(state: TourState): void {
    this.tour_view_.show(state);
    this.parts_.media.show(state);
    this.hotspots_.show(state, this.parts_.navigation.eye);
    if (state.stop?.portal) this.doors_.prepare(state.stop.portal);
    this.tour_shown.emit(state);
    this.embed_.say({ catgs: 'stop', stop: state.stop_index ?? null, playing: state.playing });
  }

  private get view(): SharedView {
    const { eye, mode } = this.parts_.navigation.camera;
    const { tour_index, stop_index } = this.player_.state;
    return { eye, mode, tour_index, stop_index };
  }

  private address(): string {
    return share_address(location.href, this.parts_.navigation.scene_id, this.view);
  }

  private file_name(): string {
    return scene_name(this.parts_.navigation.scene_id) || 'scene';
  }
}

/** What the scene's sidecar says. The name of its file is no title. */
function about_of(scene: SceneFacts): SceneAbout {
  return {
    title: scene.title === scene_name(scene.sceneId) ? '' : scene.title,
    credits: scene.credits,
    licence: scene.licence,
    mode: start_mode(scene),
    background: css_colour(scene.backgroundRgb),
    metres_per_unit: scene.metresPerUnit,
  };
}
