// The tours of the scene: plays them, and shows where the visitor is in them.
import { browser_timers } from '../base/clock';
import { Signal } from '../base/signal';
import type { PageParts } from '../page/parts';
import { max_stops, max_tours } from '../tour/limits';
import { TourPlayer, type TourState } from '../tour/player';
import type { Portal, Tour } from '../tour/tour';
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

  constructor(
    private readonly parts_: PageParts,
    private readonly scenes_: PortalScenes,
    private readonly media_: TourMediaPart,
  ) {
    const { view, clock, worker, navigation, seen, reduced_motion } = parts_;
    this.player = new TourPlayer(
      {
        camera: navigation,
        timers: browser_timers,
        now_us: () => clock.now_us(),
        announce: (samples) => worker.post({ kind: 'path', samples }),
        reached: (tour, stop) => {
          // Imported tours may be longer than those that the wire can tell of.
          if (tour < max_tours && stop < max_stops) worker.post({ kind: 'reached', tour, stop });
          media_.arrived();
        },
        when_heard: (then) => media_.when_heard(then),
        reduced_motion,
      },
      (state) => this.show(state),
    );
    const { player } = this;
    this.view_ = new TourView(player, scenes_, (portal, scene_id) =>
      this.portal_taken.emit({ portal, scene_id }),
    );
    this.hotspots_ = new Hotspots(view, seen, scenes_, (stop) => player.go_to(stop));
    navigation.taken_over.listen(() => player.pause());
    navigation.went_back.listen(() => player.leave()); // what is shown is no stop any more
    navigation.pad_pressed.listen((action) => {
      if (action === 'next') player.next();
      else if (action === 'previous') player.previous();
      else if (action === 'play') player.toggle();
    });
  }

  /** Offers these tours. The player does not have them yet. */
  offer(tours: readonly Tour[]): void {
    this.view_.show_tours(tours);
    this.media_.show_tours(this.parts_.navigation.scene_id, tours);
  }

  private show(state: TourState): void {
    this.view_.show(state);
    this.media_.show(state);
    this.hotspots_.show(state, this.parts_.navigation.eye);
    if (state.stop?.portal) this.scenes_.prepare(state.stop.portal);
    this.shown.emit(state);
  }
}
