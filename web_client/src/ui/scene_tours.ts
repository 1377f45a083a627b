// The tours of the scene: plays them, and shows where the visitor is in them.
import { browser_timers } from '../base/clock';
import { Signal } from '../base/signal';
import type { PageParts } from '../page/parts';
import { max_stops, max_tours } from '../tour/limits';
import { TourPlayer, type TourState } from '../tour/player';
import type { Portal, Tour } from '../tour/tour';
import type { ShownStop } from '../worker/messages';
import { Hotspots } from './hotspots';
import type { PortalScenes } from './portal_scenes';
import { TourView } from './tour_view';

/** Shows and plays what stops have besides words (media/). */
export interface TourMediaPart {
  show_tours(scene_id: string, tours: readonly Tour[]): void;
  show(state: TourState): void;
  /** The visitor has come to the stop that is shown. */
  arrived(): void;
  /** See TourEnvironment. */
  when_heard(then: () => void): () => void;
}

export class SceneTours {
  /** The tour or its stop has changed. */
  readonly shown = new Signal<TourState>();
  /** The visitor wants to go through this portal, and may. */
  readonly portal_taken = new Signal<{ readonly portal: Portal; readonly scene_id: string }>();
  readonly player: TourPlayer;
  private readonly view_: TourView;
  private readonly hotspots_: Hotspots;
  private told_: ShownStop | undefined; // to the server
  private guided_: ShownStop | undefined; // by the host of a shared tour

  constructor(
    private readonly parts_: PageParts,
    private readonly scenes_: PortalScenes,
    private readonly media_: TourMediaPart,
  ) {
    const { clock, worker, navigation, clipping, reduced_motion } = parts_;
    this.player = new TourPlayer(
      {
        camera: navigation,
        timers: browser_timers,
        now_us: () => clock.now_us(),
        announce: (samples) => worker.post({ kind: 'path', samples }),
        show_section: (section) => clipping.show(section),
        reached: (tour, stop) => {
          // Imported tours may be longer than those that the wire can tell of.
          if (tour < max_tours && stop < max_stops) worker.post({ kind: 'reached', tour, stop });
          media_.arrived();
          this.tell({ tour_index: tour, stop_index: stop, arrived: true });
        },
        when_heard: (then) => media_.when_heard(then),
        get reduced_motion() {
          return reduced_motion || navigation.jumps;
        },
      },
      (state) => this.show(state),
    );
    const { player } = this;
    this.view_ = new TourView(player, scenes_, (portal, scene_id) =>
      this.portal_taken.emit({ portal, scene_id }),
    );
    this.hotspots_ = new Hotspots(parts_, scenes_, (stop) => player.go_to(stop));
    navigation.entered.listen(() => (this.told_ = undefined)); // the server forgets it, too
    navigation.taken_over.listen(() => player.pause());
    navigation.went_back.listen(() => player.leave()); // what is shown is no stop any more
    navigation.pad_pressed.listen((action) => {
      if (action === 'next') player.next();
      else if (action === 'previous') player.previous();
      else if (action === 'play') player.toggle();
    });
  }

  /** Offers these tours. The player does not have them yet. */
  offer(tours: readonly Tour[], scene_id = this.parts_.navigation.scene_id): void {
    this.view_.show_tours(tours);
    this.media_.show_tours(scene_id, tours);
  }

  /** As TourPlayer does. */
  load(tours: readonly Tour[], stays: boolean): void {
    this.player.load(tours, stays);
    const { guided_: guided } = this;
    this.guided_ = undefined;
    this.guide(guided);
  }

  /** Shows what the host of a shared tour sees; undefined: the visitor is on their own. */
  guide(shown: ShownStop | undefined): void {
    const { guided_: before } = this;
    this.guided_ = shown;
    document.body.classList.toggle('shows-stop', shown?.stop_index !== undefined);
    if (!shown || (before && same_stop(shown, before, true))) return;
    if (!before || !same_stop(shown, before))
      this.player.be_shown(shown.tour_index, shown.stop_index);
    if (shown.arrived) this.media_.arrived();
  }

  /** Tells those whom this visitor may lead. */
  private tell(shown: ShownStop): void {
    const { tour_index = 0, stop_index = 0 } = shown;
    if (tour_index >= max_tours || stop_index >= max_stops) return; // of an imported tour, see above
    if (this.told_ && same_stop(shown, this.told_, true)) return;
    this.told_ = shown;
    this.parts_.worker.post({ kind: 'show', shown });
  }

  private show(state: TourState): void {
    this.view_.show(state);
    this.media_.show(state);
    this.hotspots_.show(state, this.parts_.navigation.eye);
    if (state.stop?.portal) this.scenes_.prepare(state.stop.portal);
    const shown = {
      tour_index: state.tour && state.tour_index,
      stop_index: state.stop_index,
      arrived: false,
    };
    if (!this.told_ || !same_stop(shown, this.told_)) this.tell(shown);
    this.shown.emit(state);
  }
}

const same_stop = (a: ShownStop, b: ShownStop, as_near = false): boolean =>
  a.tour_index === b.tour_index &&
  a.stop_index === b.stop_index &&
  (!as_near || a.arrived === b.arrived);
