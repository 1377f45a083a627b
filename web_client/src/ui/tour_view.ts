import { CaptionView, prepare } from '../captions/caption';
import { is_for_page, position_of } from '../input/key';
import { by_id, hint_at_more, on_click } from '../page/dom';
import { language, text } from '../text/text';
import type { TourPlayer, TourState } from '../tour/player';
import type { Portal, Stop, Tour } from '../tour/tour';
import type { PortalScenes } from './portal_scenes';

/** The card of a tour: caption, buttons and keys. */
export class TourView {
  private readonly card_ = by_id('tour', HTMLElement);
  private readonly choice_ = by_id('tour-choice', HTMLSelectElement);
  private readonly play_ = by_id('tour-play', HTMLButtonElement);
  private readonly text_ = by_id('tour-text', HTMLElement);
  private readonly caption_ = new CaptionView(this.text_, hint_at_more(this.text_));
  private readonly portal_ = by_id('tour-portal', HTMLButtonElement);
  private has_tours_ = false;

  constructor(
    player: TourPlayer,
    private readonly scenes_: PortalScenes,
    take: (portal: Portal, scene_id: string) => void,
  ) {
    this.portal_.addEventListener('click', () => {
      const portal = player.state.stop?.portal;
      const scene_id = portal && scenes_.target_of(portal).scene_id;
      if (portal && scene_id) take(portal, scene_id);
    });
    on_click('tour-previous', () => player.previous());
    on_click('tour-next', () => player.next());
    on_click('tour-play', () => player.toggle());
    this.choice_.addEventListener('change', () => player.choose(Number(this.choice_.value)));
    const actions: Readonly<Record<string, () => void>> = {
      PageDown: () => player.next(),
      PageUp: () => player.previous(),
      Space: () => player.toggle(),
    };
    window.addEventListener('keydown', (event) => {
      if (
        position_of(event) === 'Space' &&
        event.target instanceof Element &&
        event.target.closest('button, summary')
      )
        return; // a click
      const action = actions[position_of(event)];
      if (!action || !this.has_tours_ || !is_for_page(event)) return;
      if (document.body.classList.contains('watching')) return; // the host leads
      event.preventDefault();
      action();
    });
  }

  show_tours(tours: readonly Tour[]): void {
    this.has_tours_ = tours.length > 0;
    void prepare(tours.flatMap(({ stops }) => stops.map(({ caption }) => caption)));
    this.card_.hidden = !this.has_tours_;
    this.choice_.hidden = tours.length < 2;
    this.choice_.replaceChildren(
      ...tours.map(
        ({ title }, i) => new Option(title || text.tour.numbered({ n: i + 1 }), String(i)),
      ),
    );
  }

  show(state: TourState): void {
    const { tour, stop, stop_index, playing } = state;
    const count = tour?.stops.length ?? 0;
    this.choice_.value = String(state.tour_index);
    const name = tour?.title ?? '';
    const title = by_id('tour-title', HTMLElement);
    title.textContent = stop ? stop.title : name || text.tour.untitled;
    title.lang = stop || name ? ((stop ?? tour)?.language ?? '') : language;
    void this.caption_.show(stop?.caption ?? '');
    this.text_.lang = stop?.language ?? '';
    this.text_.scrollTop = 0;
    this.show_portal(stop);
    by_id('tour-position', HTMLElement).textContent =
      count === 0
        ? ''
        : stop_index === undefined
          ? text.tour.stops({ count })
          : text.tour.position({ n: stop_index + 1, count });
    for (const id of ['tour-previous', 'tour-next']) {
      by_id(id, HTMLButtonElement).hidden = count < 2;
    }
    const label = playing ? text.tour.pause : text.tour.play;
    this.play_.setAttribute('aria-label', label);
    this.play_.title = playing ? text.tour.pause_key : text.tour.play_key;
    this.play_.setAttribute('aria-pressed', String(playing));
    this.play_.querySelector('use')?.setAttribute('href', playing ? '#icon-pause' : '#icon-play');
  }

  private show_portal(stop: Stop | undefined): void {
    const target = stop?.portal && this.scenes_.target_of(stop.portal);
    const is_closed = target !== undefined && target.scene_id === undefined;
    this.portal_.hidden = target === undefined;
    this.portal_.disabled = is_closed;
    by_id('tour-portal-text', HTMLElement).textContent = target
      ? text.portals.to({ scene: target.title })
      : '';
    const closed = by_id('tour-closed', HTMLElement);
    closed.hidden = !is_closed;
    closed.textContent = is_closed ? text.portals.closed({ scene: target.title }) : '';
  }
}
