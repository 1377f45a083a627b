// Walking on the walkable area of the scene, and its floor plan. Both load when somebody needs them.
import { browser_timers } from '../base/clock';
import { load_part } from '../base/load_part';
import type { Signal } from '../base/signal';
import type { Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { is_for_page } from '../input/key';
import { by_id, make } from '../page/dom';
import type { PageParts } from '../page/parts';
import { text } from '../text/text';
import { file_name_of } from '../session/scenes';
import type { MeasureList } from '../tour/measure_list';
import type { TourState } from '../tour/player';
import type { Stand, WalkMap } from '../walk/walk_map';
import type { Dollhouse } from './dollhouse';
import type { DoorQuestion } from './door_question';
import type { PlanPanel } from './plan_panel';
import { WalkMapLoader } from './walk_map_loader';
import type { Walking } from './walking';

interface WalkableAreaParts extends PageParts {
  readonly tour_shown: Signal<TourState>;
  readonly go_to_stop: (index: number) => void;
  /** Of authors. */
  readonly set_scale: ((metres_per_unit: number) => void) | undefined;
  /** They know the scale of the scene. */
  readonly measures: MeasureList;
}

const warn = (error: unknown): void => console.warn('the walkable area cannot be used', error); // the server is away
const idle_after_ms = 2000; // the first picture

export class WalkableArea {
  private readonly loader_: WalkMapLoader;
  private readonly button_ = by_id('button-plan', HTMLButtonElement);
  private readonly panel_ = by_id('plan-panel', HTMLElement);
  private map_: WalkMap | undefined;
  private walking_: Walking | undefined;
  private plan_: PlanPanel | undefined;
  private house_: Dollhouse | undefined;
  private door_: DoorQuestion | undefined;
  private tour_: TourState | undefined;
  private eye_: Eye;
  private participants_: readonly Vec3[] = [];
  private chose_walk_ = false; // in this scene
  private idle_ = false;

  constructor(private readonly parts_: WalkableAreaParts) {
    const { navigation, worker, toolbar, seen, token, notice, tour_shown, measures } = parts_;
    this.loader_ = new WalkMapLoader(token);
    this.eye_ = navigation.eye;
    navigation.entered.listen(({ scene }) => this.enter(scene.sceneId));
    navigation.went_back.listen(() => this.house_?.close());
    navigation.taken_over.listen(() => this.walking_?.stay());
    navigation.led_away.listen(() => {
      notice.withdraw(text.floor_plan.no_floor);
      this.house_?.led_away();
      this.walking_?.stay();
    });
    navigation.mode_chosen.listen(() => {
      this.walking_?.stay();
      this.house_?.leave();
      if (navigation.camera.mode !== 'walk') return;
      this.chose_walk_ = true;
      this.walk();
    });
    window.addEventListener('keydown', (event) => {
      if (event.key === 'Escape' && is_for_page(event)) this.house_?.leave();
    });
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'plan' && shown) this.open_plan().catch(warn);
    });
    seen.moved.listen((eye) => {
      this.walking_?.move(eye);
      this.door_?.move(eye);
      if (eye.view_height !== undefined) return; // the visitor stays where they were, and sees a plan
      this.eye_ = eye;
      this.plan_?.move(eye);
    });
    navigation.changed.listen(() => this.walking_?.draw());
    tour_shown.listen((state) => {
      this.tour_ = state;
      this.show_stops();
    });
    measures.changed.listen(() => {
      this.plan_?.show_scale();
      if (measures.metres_per_unit) this.door_?.ask(undefined);
    });
    worker.on('presented', () => this.presented());
    this.loader_.computing.listen(() => notice.show(text.floor_plan.preparing, 10));
    this.loader_.known.listen((map) => {
      notice.withdraw(text.floor_plan.preparing);
      this.button_.hidden = !map;
      if (map === 'large') return;
      this.map_ = map;
      if (navigation.camera.mode === 'walk' || navigation.looks_by_default) this.walk();
      if (!this.panel_.hidden) this.open_plan().catch(warn);
      if (map) this.ask_scale(map).catch(warn);
    });
  }

  /** Undefined: it is not known, or there is none. */
  get map(): WalkMap | undefined {
    return this.map_;
  }

  /** Somebody is about to need the map. */
  want_map(): void {
    void this.loader_.want();
  }

  /** Where the eyes of other visitors are, for the plan. */
  show_participants(positions: readonly Vec3[]): void {
    this.participants_ = positions;
    this.plan_?.show_participants(positions);
  }

  private enter(scene_id: string): void {
    this.loader_.enter(scene_id);
    this.house_?.close();
    this.house_ = undefined;
    this.door_?.ask(undefined);
    this.map_ = undefined;
    this.walking_?.end();
    this.walking_ = this.plan_ = undefined;
    this.participants_ = [];
    this.parts_.toolbar.close('plan');
    this.panel_.replaceChildren();
    this.button_.hidden = true;
    this.chose_walk_ = this.idle_ = false;
    if (this.parts_.navigation.camera.mode === 'walk') void this.loader_.want();
  }

  private presented(): void {
    if (this.idle_) return;
    this.idle_ = true;
    setTimeout(() => void this.loader_.want(true), idle_after_ms);
  }

  private walk(): void {
    const { map_: map } = this;
    if (map) this.begin_walking(map).catch(warn);
    else void this.loader_.want();
  }

  /** Where the scene or a link begins with walking, visitors first see what its author has chosen. */
  private async begin_walking(map: WalkMap): Promise<void> {
    const walking = await this.make_walking(map);
    if (!walking || !this.chose_walk_ || (await walking.come_down())) return;
    this.parts_.notice.show(text.floor_plan.no_floor, 10);
  }

  private async make_walking(map: WalkMap): Promise<Walking | undefined> {
    const { Walking } = await load_part(() => import('./walking'));
    if (map !== this.map_ || this.walking_) return this.walking_;
    const { worker, navigation } = this.parts_;
    this.walking_ = new Walking(
      {
        ...this.parts_,
        timers: browser_timers,
        announce: (samples) => worker.post({ kind: 'path', samples }),
      },
      map,
    );
    navigation.set_walker(this.walking_.walker);
    return this.walking_;
  }

  private async ask_scale(map: WalkMap): Promise<void> {
    const { set_scale, measures } = this.parts_;
    if (!set_scale || measures.metres_per_unit) return;
    const { DoorQuestion } = await load_part(() => import('./door_question'));
    if (map !== this.map_) return;
    this.door_ ??= new DoorQuestion({ ...this.parts_, set_scale }, this.eye_);
    this.door_.ask(map);
  }

  private async open_plan(): Promise<void> {
    const { map_: map, parts_: parts } = this;
    if (!this.plan_)
      this.panel_.replaceChildren(make('p', { textContent: text.floor_plan.drawing }));
    if (!map) return void this.loader_.want();
    const [{ PlanPanel, Dollhouse, house_around }, walking] = await Promise.all([
      load_part(() => import('./plan')),
      this.make_walking(map),
    ]);
    const house = await house_around(map);
    if (!walking || map !== this.map_) return;
    const go_to = (stand: Stand): void => {
      parts.navigation.taken_over.emit();
      const before = this.house_?.end();
      if (before) walking.land(stand, before.eye);
      else walking.go_to(stand).catch(warn);
    };
    this.house_ ??= house && new Dollhouse({ ...parts, go_to }, map, house);
    this.plan_ ??= new PlanPanel(
      {
        storage: parts.storage,
        go_to,
        go_to_stop: parts.go_to_stop,
        dollhouse: this.house_,
        stand_at: (position) => walking.walker.stand_at(position),
        measures: parts.measures,
        scene_name: file_name_of(parts.navigation.scene_id),
      },
      map,
      this.eye_,
    );
    this.plan_.move(this.eye_);
    this.plan_.show_participants(this.participants_);
    this.show_stops();
  }

  private show_stops(): void {
    this.plan_?.show_stops(this.tour_?.tour?.stops ?? [], this.tour_?.stop_index);
  }
}
