import type { Eye } from '../camera/eye';
import { project } from '../camera/ray';
import { caption_words } from '../captions/caption';
import { pass_drags } from '../input/pass_drags';
import { by_id, icon, make } from '../page/dom';
import type { PageParts } from '../page/parts';
import { number } from '../text/number';
import { language, text } from '../text/text';
import { max_stops } from '../tour/limits';
import type { TourState } from '../tour/player';
import type { Stop, Tour } from '../tour/tour';
import type { PortalScenes } from './portal_scenes';
import { uncovered, type Cover } from './uncovered';

/** Shows the stops of a tour as buttons in the picture. */
export class Hotspots {
  private readonly host_ = by_id('hotspots', HTMLElement);
  private tour_: Tour | undefined;
  private stop_: Stop | undefined; // where the tour is
  private spots_: { readonly stop: Stop; readonly button: HTMLButtonElement }[] = [];
  private asked_ = 0; // sets of markers that the server was asked about
  private asked_about_ = ''; // the last one
  private covers_: readonly Cover[] = []; // what lies over the view
  private eye_: Eye | undefined; // of the picture that the visitor sees
  private behind_: readonly number[] = []; // indices of those that something in the scene covers

  constructor(
    private readonly parts_: Pick<PageParts, 'view' | 'seen' | 'worker' | 'navigation'>,
    private readonly scenes_: PortalScenes,
    private readonly go_to_: (stop_index: number) => void,
  ) {
    window.addEventListener('keydown', ({ key }) => {
      // A label may hide what is behind it (WCAG 1.4.13).
      if (key === 'Escape') this.host_.classList.add('labels-dismissed');
    });
    parts_.seen.moved.listen((eye) => this.put(eye));
    const elements = [...document.querySelectorAll('#tour, #toolbar, #scene-title, #shared-tour')];
    const resized = new ResizeObserver(() => {
      this.covers_ = elements
        .map((element) => element.getBoundingClientRect())
        .filter((rect) => rect.width > 0);
      if (this.eye_) this.put(this.eye_);
    });
    for (const element of [this.host_, ...elements]) resized.observe(element);
    parts_.navigation.entered.listen(() => (this.asked_about_ = ''));
    parts_.worker.on('hidden_markers', ({ id, indices }) => {
      if (id !== this.asked_) return; // an answer about other markers
      this.behind_ = indices;
      this.show_behind();
    });
  }

  /** `eye`: the camera of the view. */
  show({ tour, stop }: TourState, eye: Eye): void {
    if (tour !== this.tour_) this.show_tour(tour);
    // The tour continues, and the button of an earlier stop may still have the focus.
    if (stop !== this.stop_) this.host_.classList.add('labels-dismissed');
    this.stop_ = stop;
    for (const { stop: other, button } of this.spots_) {
      if (other === stop) button.setAttribute('aria-current', 'step');
      else button.removeAttribute('aria-current');
    }
    this.put(eye);
  }

  private put(eye: Eye): void {
    this.eye_ = eye;
    const { clientWidth: width_px, clientHeight: height_px } = this.parts_.view;
    for (const { stop, button } of this.spots_) {
      const at = stop.marker && project(stop.marker, eye, width_px / height_px);
      const inside = at && at[0] > 0 && at[0] < 1 && at[1] > 0 && at[1] < 1 ? at : undefined;
      button.hidden = !inside;
      if (!inside) continue;
      const [own_x, own_y] = [inside[0] * width_px, inside[1] * height_px];
      // The card tells of this one.
      const [x, y] = uncovered([own_x, own_y], stop === this.stop_ ? this.covers_ : [], [
        width_px,
        height_px,
      ]);
      button.classList.toggle('aside', x !== own_x || y !== own_y);
      button.style.setProperty('--towards', `${Math.atan2(own_y - y, own_x - x)}rad`);
      button.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
      button.classList.toggle('leftward', inside[0] > 0.5); // where its label has room
    }
  }

  private show_tour(tour: Tour | undefined): void {
    this.tour_ = tour;
    const { view } = this.parts_;
    this.spots_ = (tour?.stops ?? []).flatMap((stop, i) => {
      if (!stop.marker) return [];
      const target = stop.portal && this.scenes_.target_of(stop.portal);
      const sign = target ? icon('portal') : make('span', { 'aria-hidden': 'true' }, number(i + 1));
      // It is hidden until it is placed.
      const button = make('button', { type: 'button', className: 'hotspot', hidden: true }, sign);
      button.classList.toggle('portal', target !== undefined);
      button.append(label_of(stop, i, button, target && text.portals.to({ scene: target.title })));
      pass_drags(button, view);
      button.addEventListener('click', () => this.go_to_(i));
      // Whoever zooms where a hotspot is means the view.
      button.addEventListener('wheel', (event) => {
        if (!view.dispatchEvent(new WheelEvent(event.type, event))) event.preventDefault();
      });
      for (const arrival of ['pointerenter', 'focus']) {
        button.addEventListener(arrival, () => this.host_.classList.remove('labels-dismissed'));
      }
      return [{ stop, button }];
    });
    this.host_.replaceChildren(...this.spots_.map(({ button }) => button));
    this.ask();
  }

  /** Asks the server which hotspots the scene hides from here on. */
  private ask(): void {
    // The server takes no more; imported tours may have more, which stay visible.
    const points = this.spots_.slice(0, max_stops).map(({ stop }) => stop.marker!);
    const about = JSON.stringify(points);
    if (about !== this.asked_about_) {
      this.behind_ = [];
      this.asked_about_ = about;
      this.parts_.worker.post({ kind: 'markers', id: ++this.asked_, points });
    }
    this.show_behind();
  }

  private show_behind(): void {
    this.spots_.forEach(({ button }, i) =>
      button.classList.toggle('behind', this.behind_.includes(i)),
    );
  }
}

/** Where it leads or its title, and its caption. They appear when a visitor points at the hotspot or reaches it by Tab. */
function label_of(
  stop: Stop,
  index: number,
  button: HTMLButtonElement,
  leads_to: string | undefined,
): HTMLElement {
  const title = leads_to ?? (stop.title || text.tour.stop_numbered({ n: index + 1 }));
  const lang = stop.title && !leads_to ? stop.language : language;
  const label = make(
    'span',
    { className: 'hotspot-label', dir: 'auto', lang },
    make('span', { className: 'hotspot-name' }, title),
  );
  if (stop.caption) {
    // The title alone is the name of the button; the caption describes it.
    const id = `hotspot-caption-${index}`;
    const caption = make('span', { id, className: 'hotspot-caption', 'aria-hidden': 'true' });
    void caption_words(stop.caption).then((words) => (caption.textContent = words));
    label.append(caption);
    button.setAttribute('aria-describedby', id);
  }
  return label;
}
