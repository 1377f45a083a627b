// What an author is editing: the tours and what the scene's sidecar says besides. Pure.
import { normalize, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import type { CameraMode } from '../camera/mode';
import type { SceneSetup } from '../camera/scene_setup';
import { section_about } from '../camera/upright_box';
import { write_translations, type Translations } from '../text/translations';
import { write_measures, type Measure } from './measures';
import { write_tours, type Stop, type Tour } from './tour';
import { untranslated } from './words';

/** The texts about a scene that may be in several languages. */
export interface SceneWords {
  readonly title: string;
  readonly credits: string;
}

/** What visitors are told of a scene. Texts are empty where nothing is said. */
export interface SceneAbout extends SceneWords {
  readonly translations: Translations<SceneWords>;
  readonly licence: string;
  readonly mode: CameraMode | undefined;
  readonly background: string; // "#rrggbb"
  readonly metres_per_unit: number; // 0: not said
}

export const nothing_said: SceneAbout = {
  title: '',
  credits: '',
  translations: new Map(),
  licence: '',
  mode: undefined,
  background: '#000000',
  metres_per_unit: 0,
};

interface DraftState {
  readonly tours: readonly Tour[];
  /** Index of the tour that is edited. It has stops, or none yet, and is no film. */
  readonly edited: number;
  readonly about: SceneAbout;
  /** Where the author lets visits begin; undefined: where they began before. */
  readonly start: Eye | undefined;
  readonly measures: readonly Measure[];
}

const empty_tour: Tour = {
  title: '',
  ...untranslated,
  stops: [],
  way: undefined,
  starts_itself: false,
};
const most_undone = 200;

/** Keeps each state of the draft, so that an author can take back every edit. */
export class TourDraft {
  private states_: readonly DraftState[] = [
    { ...first_of([]), about: nothing_said, start: undefined, measures: [] },
  ];
  private typed_in_: string | undefined; // the field of the last edit

  load(tours: readonly Tour[], about: SceneAbout, measures: readonly Measure[] = []): void {
    this.states_ = [{ ...first_of(tours), about, start: undefined, measures }];
    this.typed_in_ = undefined;
  }

  /** Differs after each edit. Undoing an edit brings back the state before. */
  get state(): DraftState {
    return this.states_[this.states_.length - 1]!;
  }

  get tour(): Tour {
    return this.state.tours[this.state.edited]!;
  }

  get stops(): readonly Stop[] {
    return this.tour.stops;
  }

  /** Tours that can be edited: indices into `state.tours`. */
  get editable(): readonly number[] {
    return this.state.tours.flatMap(({ way }, i) => (way ? [] : [i]));
  }

  /** The tours that visitors get. */
  get shown(): readonly Tour[] {
    return this.state.tours.filter(is_shown);
  }

  /** Index of the edited tour among those shown; -1: it has no stops. */
  get shown_index(): number {
    return this.shown.indexOf(this.tour);
  }

  /** The first picture that nobody has described: the indices of its tour, its stop and itself. */
  get undescribed():
    | { readonly tour: number; readonly stop: number; readonly medium: number }
    | undefined {
    for (const [tour, { stops }] of this.state.tours.entries()) {
      for (const [stop, { media = [] }] of stops.entries()) {
        const medium = media.findIndex(({ kind, alt }) => kind === 'image' && alt === '');
        if (medium >= 0) return { tour, stop, medium };
      }
    }
    return undefined;
  }

  /** Edits another tour from here on. That changes nothing, so there is nothing to undo. */
  choose(edited: number): void {
    this.typed_in_ = undefined;
    this.states_ = [...this.states_.slice(0, -1), { ...this.state, edited }];
  }

  get can_undo(): boolean {
    return this.states_.length > 1;
  }

  undo(): void {
    this.typed_in_ = undefined;
    if (this.can_undo) this.states_ = this.states_.slice(0, -1);
  }

  /** `field`: typing on in one field is one edit. */
  edit(change: Partial<DraftState>, field?: string): void {
    const types_on = field !== undefined && field === this.typed_in_;
    const before = types_on ? this.states_.slice(0, -1) : this.states_.slice(-most_undone);
    this.states_ = [...before, { ...this.state, ...change }];
    this.typed_in_ = field;
  }

  edit_tour(change: Partial<Tour>, field?: string): void {
    const { tours, edited } = this.state;
    this.edit(
      { tours: tours.map((tour, i) => (i === edited ? { ...tour, ...change } : tour)) },
      field,
    );
  }

  edit_about(change: Partial<SceneAbout>, field?: string): void {
    this.edit({ about: { ...this.state.about, ...change } }, field);
  }

  add_tour(): void {
    const { tours } = this.state;
    this.edit({ tours: [...tours, empty_tour], edited: tours.length });
  }

  remove_tour(): void {
    const { tours, edited } = this.state;
    this.edit(first_of(tours.filter((_, i) => i !== edited)));
  }

  add(stop: Stop): void {
    this.edit_tour({ stops: [...this.stops, stop] });
  }

  remove(index: number): void {
    this.edit_tour({ stops: this.stops.filter((_, i) => i !== index) });
  }

  change(index: number, change: Partial<Stop>, field?: string): void {
    this.edit_tour(
      { stops: this.stops.map((stop, i) => (i === index ? { ...stop, ...change } : stop)) },
      field,
    );
  }

  /** Swaps a stop with its neighbour. `by`: 1 or -1. */
  move(index: number, by: number): void {
    const [stop, neighbour] = [this.stops[index], this.stops[index + by]];
    if (!stop || !neighbour) return;
    const swapped = this.stops.map((other, i) =>
      i === index ? neighbour : i === index + by ? stop : other,
    );
    this.edit_tour({ stops: swapped });
  }

  /** The whole of `<scene>.json`: the facts of the scene and the tours. `own_up`: what sections are about here. */
  sidecar(scene: SceneSetup, own_up = scene.up): object {
    const limited = scene.limits_max.some((v, i) => v > scene.limits_min[i]!);
    const { title, credits, translations, licence, mode, background, metres_per_unit } =
      this.state.about;
    const { position, orientation } = scene.start_pose;
    const measures = write_measures(this.state.measures);
    return {
      ...(title && { title }),
      ...(credits && { credits }),
      ...write_translations(translations),
      ...(licence && { licence }),
      ...(mode && { mode }),
      ...(background !== nothing_said.background && { background }),
      ...(metres_per_unit > 0 && { metres_per_unit }),
      up: scene.up,
      start_pose: { position, orientation },
      near: scene.near_z,
      ...(limited && { limits: { min: scene.limits_min, max: scene.limits_max } }),
      focus: scene.focus,
      tours: write_tours(
        this.shown.map((tour) => about_up(tour, own_up, normalize(scene.up, own_up))),
      ),
      ...(measures.length > 0 && { measures }),
    };
  }
}

const is_shown = ({ stops, way }: Tour): boolean => stops.length > 0 || way !== undefined;

const about_up = (tour: Tour, from: Vec3, to: Vec3): Tour => ({
  ...tour,
  stops: tour.stops.map((stop) => ({
    ...stop,
    section: stop.section && section_about(stop.section, from, to),
  })),
});

/** Edits the first tour that is no film, or a new one. */
function first_of(tours: readonly Tour[]): Pick<DraftState, 'tours' | 'edited'> {
  const edited = tours.findIndex(({ way }) => way === undefined);
  return edited >= 0 ? { tours, edited } : { tours: [...tours, empty_tour], edited: tours.length };
}
