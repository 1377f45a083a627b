// Measures lengths, heights and areas between points that the visitor marks.
import type { Eye } from '../camera/eye';
import { project } from '../camera/ray';
import type { Pointed } from '../input/pointers';
import { area_of, length_of, rise_of, type Mark } from '../measure/measurement';
import { system_here, systems, written, type Scale, type System } from '../measure/units';
import { by_id, make, on_click } from '../page/dom';
import type { PageParts } from '../page/parts';
import { text } from '../text/text';

const most_marks = 100;
const system_key = 'catgs.units';
const svg = 'http://www.w3.org/2000/svg';

interface MeasureParts extends PageParts {
  /** Of authors: the scene has this scale from now on. */
  readonly set_scale: ((metres_per_unit: number) => void) | undefined;
}

/** While its panel is open, clicks and taps mark points. */
export class MeasurePanel {
  private readonly lines_ = document.createElementNS(svg, 'svg');
  private readonly results_ = by_id('measure-results', HTMLElement);
  private readonly system_ = by_id('measure-system', HTMLSelectElement);
  private readonly known_ = by_id('measure-known', HTMLInputElement);
  private marks_: readonly Mark[] = [];
  private metres_per_unit_: number | undefined;
  private asked_: Promise<unknown> = Promise.resolve();
  private begun_ = 0;

  constructor(private readonly parts_: MeasureParts) {
    const { navigation, toolbar, seen, storage, set_scale } = parts_;
    this.lines_.id = 'measure-lines';
    this.lines_.setAttribute('aria-hidden', 'true');
    by_id('hotspots', HTMLElement).before(this.lines_);
    this.system_.value =
      systems.find((system) => system === storage.getItem(system_key)) ?? system_here();
    this.system_.addEventListener('change', () => {
      storage.setItem(system_key, this.system_.value);
      this.show();
    });
    on_click('measure-middle', () => void this.mark(0.5, 0.5));
    on_click('measure-undo', () => this.set(this.marks_.slice(0, -1)));
    on_click('measure-clear', () => this.set([]));
    by_id('measure-scale', HTMLElement).hidden = !set_scale;
    on_click('measure-set', () => this.set_scale());
    toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel !== 'measure') return;
      if (shown) return navigation.gestures.set('measure', this.take);
      navigation.gestures.remove('measure');
      this.set([]);
    });
    navigation.entered.listen(({ scene }) => {
      this.metres_per_unit_ = scene.metresPerUnit || undefined;
      this.set([]);
    });
    seen.moved.listen((eye) => this.draw(eye));
    this.show();
  }

  /** The first of two clicks has marked the point already. */
  private readonly take = ({ x, y, how }: Pointed): boolean => {
    if (how !== 'double tap') void this.mark(x, y);
    return true;
  };

  private get scale(): Scale {
    return { metres_per_unit: this.metres_per_unit_, system: this.system_.value as System };
  }

  /** `x`, `y`: shares of the view. */
  private async mark(x: number, y: number): Promise<void> {
    const begun = this.begun_;
    const asked = this.parts_.navigation.hit_at(x, y);
    const earlier = this.asked_;
    this.asked_ = asked;
    await earlier; // marks come in the order of the clicks
    const hit = await asked;
    if (begun !== this.begun_ || this.marks_.length >= most_marks) return;
    this.marks_ = hit ? [...this.marks_, hit] : this.marks_;
    this.show();
    if (!hit) this.results_.replaceChildren(make('p', {}, text.measure.nothing_there));
  }

  /** Marks that are still asked for do not count any more. */
  private set(marks: readonly Mark[]): void {
    this.marks_ = marks;
    this.begun_ += 1;
    this.show();
  }

  private show(): void {
    const { marks_: marks, scale } = this;
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
    by_id('measure-undo', HTMLButtonElement).disabled = marks.length === 0;
    by_id('measure-clear', HTMLButtonElement).disabled = marks.length === 0;
    by_id('measure-set', HTMLButtonElement).disabled = marks.length < 2;
    this.draw(this.parts_.navigation.eye);
  }

  /** The marked line is as long as the author says, in metres. */
  private set_scale(): void {
    const known = Number(this.known_.value);
    const { value } = length_of(this.marks_);
    const metres_per_unit = known / value;
    if (!(metres_per_unit >= 1e-6 && metres_per_unit <= 1e6)) return;
    this.metres_per_unit_ = Number(metres_per_unit.toPrecision(6));
    this.parts_.set_scale?.(this.metres_per_unit_);
    this.show();
  }

  private draw(eye: Eye): void {
    if (this.marks_.length === 0 && !this.lines_.firstChild) return;
    const { clientWidth: width_px, clientHeight: height_px } = this.parts_.view;
    const points = this.marks_.map(({ point }) =>
      project(point, eye, width_px / Math.max(1, height_px)),
    );
    const drawn = points.flatMap((at, i) => {
      if (!at) return []; // behind the camera
      const [x, y] = [at[0] * width_px, at[1] * height_px].map((px) => px.toFixed(1));
      const dot = shape('circle', { cx: x!, cy: y!, r: '5' });
      const to = points[i + 1];
      const end = to && { x2: (to[0] * width_px).toFixed(1), y2: (to[1] * height_px).toFixed(1) };
      return end ? [shape('line', { x1: x!, y1: y!, ...end }), dot] : [dot];
    });
    this.lines_.replaceChildren(...drawn);
  }
}

function shape(name: 'circle' | 'line', attributes: Readonly<Record<string, string>>): SVGElement {
  const element = document.createElementNS(svg, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  return element;
}
