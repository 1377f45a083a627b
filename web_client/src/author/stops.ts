import { make } from '../page/dom';
import { number_in } from '../page/number_field';
import { lasting_name } from '../portals/portals';
import { scene_labels, type SceneListing } from '../session/scenes';
import { number } from '../text/number';
import { text } from '../text/text';
import { longest_flight_s, longest_stay_s, max_text_characters } from '../tour/limits';
import { default_stay_s, type Stop, type Tour } from '../tour/tour';
import { words_for } from '../tour/words';

/** The fields for pictures, films and sounds (media/author_media.ts). */
export interface MediaFields {
  /** Another scene is edited. `token`: lets its holder add files; undefined: nobody may. */
  use(scene_id: string, token: string | undefined): void;
  /** `n`: its number, as people write it. */
  of_stop(
    stop: () => Stop,
    n: string,
    language: string,
    change: (change: Partial<Stop>, field?: string) => void,
  ): HTMLElement;
  of_tour(
    tour: Tour,
    language: string,
    change: (change: Partial<Tour>, field?: string) => void,
  ): HTMLElement;
}

export interface StopActions {
  stop(index: number): Stop;
  /** `field`: where the author types. */
  change(index: number, change: Partial<Stop>, field?: string): void;
  go_to(index: number): void;
  take_view(index: number): void;
  /** Puts the marker into the middle of the view. */
  take_marker(index: number): void;
  move(index: number, by: number): void;
  remove(index: number): void;
}

/** The stops of a tour, with fields and buttons. The open one shows all of them. */
export class AuthorStops {
  private open_ = 0;
  private language_ = '';
  private scenes_: readonly SceneListing[] = []; // that a stop may lead to
  private names_: readonly string[] = []; // by which stops name them

  constructor(
    private readonly list_: HTMLElement,
    private readonly actions_: StopActions,
    private readonly media_: MediaFields,
  ) {}

  /** Shows the stops, with their texts for one language (words.ts). The focus stays on the control where it is, in the row of stop `open`. */
  show(stops: readonly Stop[], language: string, open = this.open_): void {
    this.language_ = language;
    const focused = document.activeElement;
    const control =
      focused instanceof HTMLElement && this.list_.contains(focused)
        ? focused.dataset['control']
        : undefined;
    this.open_ = Math.min(open, Math.max(0, stops.length - 1));
    this.list_.replaceChildren(...stops.map((stop, i) => this.row_of(stop, i, stops.length)));
    if (control !== undefined) this.focus(control);
  }

  /** Other scenes that stops may lead to. */
  offer(scenes: readonly SceneListing[], present_id: string): void {
    this.scenes_ = scenes.filter(({ id }) => id !== present_id);
    this.names_ = this.scenes_.map(({ id }) => lasting_name(id, scenes));
  }

  /** Focuses a control of the open stop, or its title where the control can do nothing. */
  focus(control: string): void {
    const row = this.list_.children[this.open_];
    const find = (name: string): HTMLElement | null =>
      row?.querySelector<HTMLElement>(`[data-control="${name}"]:not(:disabled)`) ?? null;
    (find(control) ?? find('title'))?.focus();
  }

  /** Leads the author to a field of the open stop, and says there what is wrong with it. */
  demand(control: string, why: string): void {
    const field = this.list_.children[this.open_]?.querySelector<HTMLInputElement>(
      `[data-control="${control}"]`,
    );
    const fold = field?.closest('details');
    if (fold) fold.open = true;
    field?.setCustomValidity(why);
    field?.reportValidity();
  }

  private row_of(stop: Stop, i: number, count: number): HTMLElement {
    const { actions_: actions } = this;
    const media = this.media_.of_stop(
      () => actions.stop(i),
      number(i + 1),
      this.language_,
      (change, field) => actions.change(i, change, field && `${field} ${i}`),
    );
    const item = make('li', {}, ...this.fields_of(stop, i), media, this.buttons_of(stop, i, count));
    item.classList.toggle('open', i === this.open_);
    item.addEventListener('focusin', () => this.open(i));
    return item;
  }

  private fields_of(stop: Stop, i: number): HTMLElement[] {
    const words = text.author;
    const n = number(i + 1);
    const written = words_for(stop, this.language_);
    const in_its_own = { dir: 'auto', lang: this.language_ };
    // A translation that is empty is replaced by what stands behind it.
    const behind = this.language_ === '' ? { title: '', caption: words.caption_here } : stop;
    const title = make('input', {
      value: written.title,
      maxLength: 200,
      placeholder: behind.title,
      ...in_its_own,
      'aria-label': words.title({ n }),
    });
    const caption = make('textarea', {
      value: written.caption,
      rows: 2,
      maxLength: max_text_characters,
      ...in_its_own,
      placeholder: behind.caption || words.caption_here,
      'aria-label': words.caption({ n }),
      title: words.markdown,
    });
    const seconds = (label: string, value: number | undefined, usual: string): HTMLInputElement =>
      make('input', {
        inputMode: 'decimal',
        placeholder: usual,
        value: value === undefined ? '' : number(value, { useGrouping: false }),
        'aria-label': words.of_stop({ field: label, n }),
      });
    const stay = seconds(words.stay, stop.stay_s, number(Math.round(default_stay_s(stop))));
    const flight = seconds(words.flight, stop.fly_s, words.automatic);
    const bind = (
      field: HTMLInputElement | HTMLTextAreaElement,
      name: string,
      read: () => Partial<Stop>,
    ): void => {
      field.dataset['control'] = name;
      field.addEventListener('input', () => {
        const change = read();
        if (field.checkValidity()) this.actions_.change(i, change, `${name} ${i}`);
      });
    };
    bind(title, 'title', () => ({ title: title.value }));
    bind(caption, 'caption', () => ({ caption: caption.value }));
    bind(stay, 'stay', () => ({ stay_s: number_in(stay, 0, longest_stay_s) }));
    bind(flight, 'flight', () => ({ fly_s: number_in(flight, 0, longest_flight_s) }));
    const times = make(
      'div',
      {},
      make('label', {}, words.flight, flight),
      make('label', {}, words.stay, stay),
    );
    times.className = 'times';
    return [title, caption, times, ...this.portal_of(stop, i, n)];
  }

  /** The scene that the stop leads to, where there is another one. */
  private portal_of(stop: Stop, i: number, n: string): HTMLElement[] {
    const { portals: words } = text;
    const now = stop.portal?.scene ?? '';
    if (this.scenes_.length === 0 && now === '') return [];
    const labels = scene_labels(this.scenes_);
    const options = this.scenes_.map(({ id }, k) => ({
      name: this.names_[k]!,
      id,
      label: labels[k] ?? id,
    }));
    const known = options.find(({ name, id }) => now === name || now === id)?.name;
    const choice = make(
      'select',
      { 'aria-label': words.of_stop({ n }) },
      new Option(words.nowhere, ''),
      ...(now !== '' && known === undefined ? [new Option(now, now)] : []), // a scene that is not here
      ...options.map(({ name, label }) => new Option(label, name)),
    );
    choice.value = known ?? now;
    choice.dataset['control'] = 'portal';
    choice.addEventListener('change', () => {
      const { value: scene } = choice;
      const portal =
        scene === ''
          ? undefined
          : { scene, view: undefined, tour_index: undefined, stop_index: undefined };
      this.actions_.change(i, { portal });
    });
    return [make('label', { className: 'leads-to' }, words.leads_to, choice)];
  }

  private buttons_of(stop: Stop, i: number, count: number): HTMLElement {
    const words = text.author;
    const n = number(i + 1);
    const { actions_: actions } = this;
    const button = (
      control: string,
      name: string,
      onclick: () => void,
      sign = name,
      disabled = false,
    ): HTMLElement => {
      const said = sign === name ? {} : { 'aria-label': name, title: name };
      const made = make('button', { type: 'button', disabled, onclick, ...said }, sign);
      made.dataset['control'] = control;
      return made;
    };
    const marker = stop.marker
      ? button('marker', words.no_hotspot, () => actions.change(i, { marker: undefined }))
      : button('marker', words.hotspot_here, () => actions.take_marker(i));
    return make(
      'div',
      {},
      button('show', words.show, () => actions.go_to(i)),
      button('view', words.view_here, () => actions.take_view(i)),
      marker,
      button('up', words.up({ n }), () => actions.move(i, -1), '↑', i === 0),
      button('down', words.down({ n }), () => actions.move(i, 1), '↓', i === count - 1),
      button('remove', words.remove({ n }), () => actions.remove(i), '×'),
    );
  }

  private open(index: number): void {
    this.open_ = index;
    [...this.list_.children].forEach((item, i) => item.classList.toggle('open', i === index));
  }
}
