// The measures in a scene: its author's, and those that the visitor makes. Pure.
import { Signal } from '../base/signal';
import type { Mark } from '../measure/measurement';
import { max_marks, max_measures } from './limits';
import { measure_of, without, type Measure } from './measures';
import { worded } from './words';

export class MeasureList {
  /** Its value is what is typed in or dragged, if anything is: all of that is one edit. */
  readonly changed = new Signal<string | undefined>();
  private own_: readonly Measure[] = [];
  private of_scene_: readonly Measure[] = [];
  private chosen_: number | undefined; // index in `all`
  private language_ = '';
  private metres_per_unit_: number | undefined;
  private known_: Promise<unknown> = Promise.resolve();

  /** Undefined: nobody has said it. */
  get metres_per_unit(): number | undefined {
    return this.metres_per_unit_;
  }

  set_scale(metres_per_unit: number | undefined): void {
    if (metres_per_unit === this.metres_per_unit_) return;
    this.metres_per_unit_ = metres_per_unit;
    this.changed.emit(undefined);
  }

  /** Those that the visitor may change. To the author of the scene, all are their own. */
  get own(): readonly Measure[] {
    return this.own_;
  }

  /** Those of the scene's author behind them. */
  get all(): readonly Measure[] {
    return [...this.own_, ...this.of_scene_];
  }

  /** The index in `all` of the one that grows and whose values are shown. */
  get chosen(): number | undefined {
    return this.chosen_;
  }

  /** Tag of the language whose names are edited; '' for all visitors. */
  get language(): string {
    return this.language_;
  }

  /** Resolves when the marks that were asked for so far are known. */
  get known(): Promise<unknown> {
    return this.known_;
  }

  edit_language(tag: string): void {
    if (tag === this.language_) return;
    this.language_ = tag;
    this.changed.emit(undefined);
  }

  /** The measures of a scene that the visitor has entered. `of_scene`: those that they may not change. */
  enter(own: readonly Measure[], of_scene: readonly Measure[]): void {
    this.of_scene_ = of_scene;
    this.set(of_scene.length > 0 ? without(own, of_scene) : own, undefined);
  }

  /** Adds those of a link, as far as there is room and they are not there. */
  join(linked: readonly Measure[]): void {
    const own = [...this.own_, ...without(linked, this.all)];
    this.set(own.slice(0, max_measures), this.chosen_);
  }

  /** Replaces those that the visitor may change. */
  load(own: readonly Measure[]): void {
    this.set(
      own,
      this.chosen_ !== undefined && this.chosen_ < own.length ? this.chosen_ : undefined,
    );
  }

  /** The next mark begins another measure where none is chosen. */
  choose(index: number | undefined): void {
    if (index !== this.chosen_) this.set(this.own_, index);
  }

  /** Adds a mark when it is known, after those that were asked for before, if it still counts then. */
  add_found(
    asked: Promise<Mark | undefined>,
    counts: () => boolean,
  ): Promise<'added' | 'nothing' | 'full' | 'outdated'> {
    const added = Promise.all([asked, this.known_]).then(([mark]) => {
      if (!counts()) return 'outdated';
      if (!mark) return 'nothing';
      return this.add(mark) ? 'added' : 'full';
    });
    this.known_ = added;
    return added;
  }

  /** Returns whether there is room for the mark. */
  add(mark: Mark): boolean {
    const chosen = this.chosen_ === undefined ? undefined : this.own_[this.chosen_];
    if (chosen) {
      if (chosen.marks.length >= max_marks) return false;
      this.change(this.chosen_!, { marks: [...chosen.marks, mark] });
    } else {
      if (this.own_.length >= max_measures) return false;
      this.set([...this.own_, measure_of([mark])], this.own_.length);
    }
    return true;
  }

  /** `mark`: index in its measure. */
  move(index: number, mark: number, to: Mark): void {
    const marks = this.own_[index]?.marks;
    if (!marks?.[mark]) return; // it has been removed meanwhile
    const moved = marks.map((other, i) => (i === mark ? to : other));
    this.change(index, { marks: moved }, `mark ${index} ${mark}`);
  }

  rename(index: number, title: string): void {
    const measure = this.own_[index];
    if (!measure) return;
    const { language_: language } = this;
    this.change(index, worded(measure, language, { title }), `name ${index} ${language}`);
  }

  /** Removes a mark of a measure, and the measure with its last mark. */
  remove_mark(index: number, mark: number): void {
    const marks = (this.own_[index]?.marks ?? []).filter((_, i) => i !== mark);
    if (marks.length > 0) this.change(index, { marks });
    else this.remove(index);
  }

  remove(index: number): void {
    const own = this.own_.filter((_, i) => i !== index);
    this.set(own, own.length > 0 ? Math.min(index, own.length - 1) : undefined);
  }

  private change(index: number, change: Partial<Measure>, field?: string): void {
    const own = this.own_.map((other, i) => (i === index ? { ...other, ...change } : other));
    this.set(own, index, field);
  }

  private set(own: readonly Measure[], chosen: number | undefined, field?: string): void {
    this.own_ = own;
    this.chosen_ = chosen;
    this.changed.emit(field);
  }
}
