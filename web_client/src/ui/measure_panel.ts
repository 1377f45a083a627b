// Measures lengths, heights and areas between points that the visitor marks.
import { area_of, length_of, rise_of, type Mark } from '../measure/measurement';
import {
  keep_system,
  kept_system,
  systems,
  written,
  written_on_line,
  type Scale,
  type System,
} from '../measure/units';
import type { Pointed } from '../input/pointers';
import { by_id, make, on_click } from '../page/dom';
import { number_in } from '../page/number_field';
import type { PageParts } from '../page/parts';
import { number } from '../text/number';
import { text } from '../text/text';
import { max_marks, max_measures } from '../tour/limits';
import type { MeasureList } from '../tour/measure_list';
import { has_length, type Measure } from '../tour/measures';
import { words_for } from '../tour/words';
import { MeasureLines } from './measure_lines';
import './measure.css';

const units_per_metre = 1e6; // at most, and at least its inverse

interface MeasureParts extends PageParts {
  readonly measures: MeasureList;
  /** Of authors: the scene has this scale from now on. */
  readonly set_scale: ((metres_per_unit: number) => void) | undefined;
}

/** While its panel is open, clicks and taps mark points. */
export class MeasurePanel {
  private readonly results_ = by_id('measure-results', HTMLElement);
  private readonly said_ = by_id('measure-said', HTMLOutputElement);
  private readonly rows_ = by_id('measure-list', HTMLOListElement);
  private readonly system_ = by_id('measure-system', HTMLSelectElement);
  private readonly known_ = by_id('measure-known', HTMLInputElement);
  private readonly lines_: MeasureLines;
  private is_open_ = false;

  constructor(private readonly parts_: MeasureParts) {
    const { toolbar, seen, measures, set_scale } = parts_;
    this.lines_ = new MeasureLines(
      {
        ...parts_,
        list: measures,
        scale: () => this.scale,
        nothing_there: () => this.say(text.measure.nothing_there),
        name_of: (index) => this.name_of(index),
      },
      by_id('hotspots', HTMLElement),
    );
    this.bind_units();
    on_click('measure-middle', () => void this.mark(0.5, 0.5));
    on_click('measure-undo', () => {
      const { chosen, own } = measures;
      if (chosen !== undefined) measures.remove_mark(chosen, own[chosen]!.marks.length - 1);
    });
    on_click('measure-new', () => measures.choose(undefined));
    on_click('measure-clear', () => measures.load([]));
    by_id('measure-scale', HTMLElement).hidden = !set_scale;
    by_id('measure-published', HTMLElement).hidden = !set_scale;
    on_click('measure-set', () => this.set_scale());
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'measure') this.open(shown);
    });
    seen.moved.listen((eye) => this.lines_.draw(eye));
    measures.changed.listen(() => this.show());
    this.open(!by_id('measure-panel', HTMLElement).hidden);
  }

  private open(shown: boolean): void {
    const { gestures } = this.parts_.navigation;
    this.is_open_ = shown;
    if (shown) gestures.set('measure', this.take);
    else gestures.remove('measure');
    this.show();
  }

  private bind_units(): void {
    const { storage, measures } = this.parts_;
    this.system_.value = kept_system(storage);
    this.system_.addEventListener('change', () => {
      keep_system(storage, systems.find((system) => system === this.system_.value)!);
      measures.changed.emit(undefined);
    });
  }

  /** The first of two clicks has marked the point already. */
  private readonly take = ({ x, y, how }: Pointed): boolean => {
    if (how !== 'double tap') void this.mark(x, y);
    return true;
  };

  private get scale(): Scale {
    const { metres_per_unit } = this.parts_.measures;
    return { metres_per_unit, system: this.system_.value as System };
  }

  /** `x`, `y`: shares of the view. */
  private async mark(x: number, y: number): Promise<void> {
    const { measures, navigation } = this.parts_;
    const { scene_id } = navigation;
    const is_here = (): boolean => navigation.scene_id === scene_id;
    const what = await measures.add_found(navigation.hit_at(x, y), is_here);
    if (what === 'nothing') this.say(text.measure.nothing_there);
    else if (what === 'full')
      this.say(text.measure.too_many({ measures: max_measures, marks: max_marks }));
  }

  private say(what: string): void {
    this.said_.textContent = what;
  }

  private name_of(index: number): string {
    const title = this.parts_.measures.all[index]?.title;
    return title || text.measure.numbered({ n: number(index + 1) });
  }

  private show(): void {
    const { measures, navigation } = this.parts_;
    const { own, chosen } = measures;
    // In a frame of another page, a link shows its measures without the panel.
    this.lines_.shown =
      this.is_open_ || (own.length > 0 && document.body.classList.contains('bare'));
    this.say('');
    this.show_rows();
    this.show_results(chosen === undefined ? [] : measures.all[chosen]!.marks);
    const is_own = chosen !== undefined && chosen < own.length;
    by_id('measure-undo', HTMLButtonElement).disabled = !is_own;
    by_id('measure-new', HTMLButtonElement).disabled = chosen === undefined;
    by_id('measure-clear', HTMLButtonElement).disabled = own.length === 0;
    by_id('measure-set', HTMLButtonElement).disabled =
      chosen === undefined || !has_length(measures.all[chosen]!);
    this.lines_.draw(navigation.eye);
  }

  private show_results(marks: readonly Mark[]): void {
    const { scale } = this;
    const { up } = this.parts_.navigation.camera;
    const rows: (readonly [string, string])[] = [];
    if (marks.length >= 2) {
      rows.push([text.measure.length, written(length_of(marks), scale)]);
      rows.push([text.measure.height, written(rise_of(marks, up), scale)]);
    }
    if (marks.length >= 3) rows.push([text.measure.area, written(area_of(marks), scale, 2)]);
    const cells = rows.flatMap(([name, value]) => [
      make('dt', {}, name),
      make('dd', { dir: 'ltr' }, value),
    ]);
    const hint = scale.metres_per_unit ? [] : [make('p', {}, text.measure.no_scale)];
    this.results_.replaceChildren(
      ...(rows.length > 0
        ? [make('dl', {}, ...cells), ...hint]
        : [make('p', {}, text.measure.hint)]),
    );
  }

  /** One row for each measure. A field stays the same element while somebody types in it. */
  private show_rows(): void {
    const { all, own, chosen } = this.parts_.measures;
    const kinds = all.map((_, i) => (i < own.length ? 'own' : 'scene'));
    const rows = [...this.rows_.children] as HTMLLIElement[];
    const fits = rows.length === kinds.length && rows.every((row, i) => row.className === kinds[i]);
    if (!fits) {
      const focused = rows.findIndex((row) => row.contains(document.activeElement));
      this.rows_.replaceChildren(...kinds.map((kind, i) => this.make_row(kind, i)));
      if (focused >= 0) this.focus_row(Math.min(focused, kinds.length - 1));
    }
    for (const [i, row] of [...this.rows_.children].entries()) {
      this.fill_row(row, all[i]!, i);
      if (i === chosen) row.setAttribute('aria-current', 'true');
      else row.removeAttribute('aria-current');
    }
    this.rows_.hidden = all.length === 0;
  }

  private focus_row(index: number): void {
    const row = this.rows_.children[index];
    const next = row?.querySelector<HTMLElement>('button:last-child, input');
    (next ?? by_id('measure-middle', HTMLButtonElement)).focus();
  }

  private make_row(kind: 'own' | 'scene', i: number): HTMLLIElement {
    const { measures } = this.parts_;
    const value = make('span', { className: 'value', dir: 'ltr' });
    const choose = (): void => measures.choose(i);
    if (kind === 'scene') {
      const button = make('button', { type: 'button', onclick: choose, dir: 'auto' });
      return make('li', { className: kind }, button, value);
    }
    const n = number(i + 1);
    const name = make('input', {
      dir: 'auto',
      maxLength: 200,
      'aria-label': text.measure.name({ n }),
      onfocus: choose,
      oninput: () => measures.rename(i, name.value),
    });
    const label = text.measure.remove({ n });
    const remove = make(
      'button',
      { type: 'button', title: label, 'aria-label': label, onclick: () => measures.remove(i) },
      '×',
    );
    return make('li', { className: kind, onclick: choose }, name, value, remove);
  }

  private fill_row(row: Element, measure: Measure, i: number): void {
    const { language } = this.parts_.measures;
    const [head, value] = row.children;
    if (head instanceof HTMLInputElement) {
      const { title } = words_for(measure, language);
      if (head.value !== title) head.value = title;
      head.placeholder = this.name_of(i);
      head.lang = language;
    } else if (head instanceof HTMLElement) {
      head.textContent = this.name_of(i);
      head.lang = measure.language;
    }
    value!.textContent = has_length(measure)
      ? written_on_line(length_of(measure.marks), this.scale)
      : '';
  }

  /** The chosen line is as long as the author says, in metres. */
  private set_scale(): void {
    const { measures } = this.parts_;
    const chosen = measures.chosen === undefined ? undefined : measures.all[measures.chosen];
    const { value } = length_of(chosen?.marks ?? []);
    if (value === 0) return;
    const known = number_in(this.known_, value / units_per_metre, value * units_per_metre);
    if (known === undefined) return void this.known_.reportValidity();
    this.parts_.set_scale?.(Number((known / value).toPrecision(6)));
  }
}
