import type { Eye } from '../camera/eye';
import { place_of } from '../camera/ray';
import { is_typing } from '../input/view_input';
import { text } from '../text';
import type { TourPlayer, TourState } from '../tour/player';
import type { Stop, Tour } from '../tour/tour';
import { by_id } from './dom';

/** Caption and buttons of the tour, its keys, and the hotspots in the picture. */
export class TourView {
  private readonly card_ = by_id('tour', HTMLElement);
  private readonly hotspots_ = by_id('hotspots', HTMLElement);
  private readonly choice_ = by_id('tour-choice', HTMLSelectElement);
  private readonly play_ = by_id('tour-play', HTMLButtonElement);
  private player_: TourPlayer | undefined;
  private tours_: readonly Tour[] = [];
  private tour_: Tour | undefined;
  private spots_: { readonly stop: Stop; readonly button: HTMLButtonElement }[] = [];

  /** Before anything else is called. */
  bind(player: TourPlayer): void {
    this.player_ = player;
    const click = (id: string, action: () => void): void =>
      by_id(id, HTMLButtonElement).addEventListener('click', action);
    click('tour-previous', () => player.previous());
    click('tour-next', () => player.next());
    click('tour-play', () => player.toggle());
    this.choice_.addEventListener('change', () => player.choose(Number(this.choice_.value)));
    const actions: Readonly<Record<string, () => void>> = {
      PageDown: () => player.next(),
      PageUp: () => player.previous(),
      Space: () => player.toggle(),
    };
    window.addEventListener('keydown', (event) => {
      const { target } = event;
      // A label may hide what is behind it (WCAG 1.4.13).
      if (event.code === 'Escape') this.hotspots_.classList.add('labels-dismissed');
      if (event.ctrlKey || event.metaKey || event.altKey || is_typing(target)) return;
      if (event.code === 'Space' && target instanceof HTMLButtonElement) return; // a click
      const action = actions[event.code];
      if (!action || this.tours_.length === 0) return;
      event.preventDefault();
      action();
    });
  }

  /** What may be gone on. Stops may have changed within a tour. */
  show_tours(tours: readonly Tour[]): void {
    this.tours_ = tours;
    this.card_.hidden = tours.length === 0;
    this.choice_.hidden = tours.length < 2;
    this.choice_.replaceChildren(
      ...tours.map(({ title }, i) => new Option(title || text.tour.numbered(i + 1), String(i))),
    );
    this.tour_ = undefined;
  }

  show(state: TourState): void {
    const { tour, stop, stop_index, playing } = state;
    if (tour !== this.tour_) this.show_hotspots(tour);
    const count = tour?.stops.length ?? 0;
    this.choice_.value = String(state.tour_index);
    const name = tour?.title ?? '';
    by_id('tour-title', HTMLElement).textContent = stop ? stop.title : name || text.tour.untitled;
    by_id('tour-text', HTMLElement).textContent = stop?.caption ?? '';
    by_id('tour-place', HTMLElement).textContent =
      count === 0 ? '' : stop_index === undefined ? text.tour.stops(count) : text.tour.place(stop_index + 1, count);
    for (const id of ['tour-previous', 'tour-next']) {
      by_id(id, HTMLButtonElement).hidden = count < 2;
    }
    const label = playing ? text.tour.pause : text.tour.play;
    this.play_.setAttribute('aria-label', label);
    this.play_.title = `${label} (Space)`;
    this.play_.setAttribute('aria-pressed', String(playing));
    this.play_.querySelector('use')?.setAttribute('href', playing ? '#icon-pause' : '#icon-play');
    this.spots_.forEach(({ stop: of, button }) => {
      if (of === stop) button.setAttribute('aria-current', 'step');
      else button.removeAttribute('aria-current');
    });
  }

  /** Puts the hotspots where the scene is seen. */
  place(eye: Eye, width_px: number, height_px: number): void {
    for (const { stop, button } of this.spots_) {
      const place = stop.marker && place_of(stop.marker, eye, width_px / height_px);
      const inside =
        place && place[0] > 0 && place[0] < 1 && place[1] > 0 && place[1] < 1 ? place : undefined;
      button.hidden = !inside;
      if (!inside) continue;
      const [x, y] = [inside[0] * width_px, inside[1] * height_px];
      button.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      button.classList.toggle('leftward', inside[0] > 0.5); // where its label has room
    }
  }

  private show_hotspots(tour: Tour | undefined): void {
    this.tour_ = tour;
    this.spots_ = (tour?.stops ?? []).flatMap((stop, i) => {
      if (!stop.marker) return [];
      const button = document.createElement('button');
      button.type = 'button';
      button.className = 'hotspot';
      button.hidden = true; // until it is placed
      const number = document.createElement('span');
      number.textContent = String(i + 1);
      number.setAttribute('aria-hidden', 'true');
      button.append(number, label_of(stop, i, button));
      button.addEventListener('click', () => this.player_?.go_to(i));
      for (const arrival of ['pointerenter', 'focus']) {
        button.addEventListener(arrival, () => this.hotspots_.classList.remove('labels-dismissed'));
      }
      return [{ stop, button }];
    });
    this.hotspots_.replaceChildren(...this.spots_.map(({ button }) => button));
  }
}

/** Title and caption, shown to who points at the hotspot or goes to it by keys. */
function label_of(stop: Stop, index: number, button: HTMLButtonElement): HTMLElement {
  const label = document.createElement('span');
  label.className = 'hotspot-label';
  const name = document.createElement('span');
  name.className = 'hotspot-name';
  name.textContent = stop.title || text.tour.stop_numbered(index + 1);
  label.append(name);
  if (stop.caption) {
    // It describes the button, whose name is the title alone.
    const caption = document.createElement('span');
    caption.className = 'hotspot-caption';
    caption.id = `hotspot-caption-${index}`;
    caption.textContent = stop.caption;
    caption.setAttribute('aria-hidden', 'true');
    button.setAttribute('aria-describedby', caption.id);
    label.append(caption);
  }
  return label;
}
