// Draws measures over the picture: lines with their lengths, and marks that can be dragged.
import type { Eye } from '../camera/eye';
import { project, visible_part } from '../camera/ray';
import { area_of, length_of, type Mark } from '../measure/measurement';
import { written_on_line, type Scale } from '../measure/units';
import { make } from '../page/dom';
import type { PageParts } from '../page/parts';
import { number } from '../text/number';
import { text } from '../text/text';
import type { MeasureList } from '../tour/measure_list';
import type { Measure } from '../tour/measures';

const svg = 'http://www.w3.org/2000/svg';
const still_px = 3; // a hand trembles
const key_step_px = 4;
const name_above_px = 12;
const steps: Readonly<Record<string, readonly [x: number, y: number]>> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

interface LineParts extends Pick<PageParts, 'view' | 'navigation'> {
  readonly list: MeasureList;
  readonly scale: () => Scale;
  /** A mark was put where nothing is. */
  readonly nothing_there: () => void;
  readonly name_of: (index: number) => string;
}

interface Dragged {
  readonly measure: number;
  readonly mark: number;
  /** Where the pointer is, px of the view. */
  readonly at: readonly [x: number, y: number];
}

type Point = readonly [x: number, y: number];

export class MeasureLines {
  shown = false;
  private readonly lines_ = document.createElementNS(svg, 'svg');
  private readonly host_ = make('div', { id: 'measure-marks' });
  private handles_: HTMLButtonElement[] = [];
  private dragged_: Dragged | undefined;
  private asks_ = false; // what is under the dragged mark

  constructor(
    private readonly parts_: LineParts,
    before: HTMLElement,
  ) {
    this.lines_.id = 'measure-lines';
    this.lines_.setAttribute('aria-hidden', 'true');
    before.before(this.lines_, this.host_);
  }

  draw(eye: Eye): void {
    const { list } = this.parts_;
    const measures = this.shown ? list.all : [];
    if (measures.length === 0 && !this.lines_.firstChild) return;
    this.lines_.replaceChildren(...measures.flatMap((measure, i) => this.drawn(measure, i, eye)));
    this.place_handles(this.shown ? list.own : [], eye);
  }

  private get size(): Point {
    const { clientWidth, clientHeight } = this.parts_.view;
    return [clientWidth, Math.max(1, clientHeight)];
  }

  /** Where a mark is in the view, px; undefined: behind the camera. */
  private px_of(point: Mark['point'], eye: Eye): Point | undefined {
    const [width, height] = this.size;
    const at = project(point, eye, width / height);
    return at && [at[0] * width, at[1] * height];
  }

  private drawn(measure: Measure, index: number, eye: Eye): SVGElement[] {
    const { marks, title } = measure;
    const { list, scale } = this.parts_;
    const [width, height] = this.size;
    const points = marks.map(({ point }, k) =>
      this.dragged_?.measure === index && this.dragged_.mark === k
        ? this.dragged_.at
        : this.px_of(point, eye),
    );
    const numbers: SVGElement[] = [];
    const lines = marks.slice(1).flatMap((to, k) => {
      const from = marks[k]!;
      const ends = this.is_dragged(index, k, k + 1)
        ? [points[k], points[k + 1]]
        : visible_part(from.point, to.point, eye, width / height)?.map(
            ([x, y]): Point => [x * width, y * height],
          );
      const [a, b] = ends ?? [];
      if (!a || !b) return [];
      const middle: Point = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
      numbers.push(label(middle, written_on_line(length_of([from, to]), scale())));
      return [shape('line', { x1: a[0], y1: a[1], x2: b[0], y2: b[1] })];
    });
    const seen = points.filter((at) => at !== undefined);
    if (marks.length >= 3 && index === list.chosen && seen.length === marks.length) {
      const [x, y] = seen.reduce(([sx, sy], at) => [sx + at[0], sy + at[1]], [0, 0]);
      const middle: Point = [x / seen.length, y / seen.length];
      numbers.push(label(middle, written_on_line(area_of(marks), scale(), 2), 'area'));
    }
    const [first] = points;
    if (first && title) numbers.push(label([first[0], first[1] - name_above_px], title, 'name'));
    const dots = seen.map(([cx, cy]) => shape('circle', { cx, cy, r: 5 }));
    return [...lines, ...dots, ...numbers];
  }

  private is_dragged(index: number, ...marks: readonly number[]): boolean {
    return this.dragged_?.measure === index && marks.includes(this.dragged_.mark);
  }

  /** A handle stays the same element while it is dragged. */
  private place_handles(own: readonly Measure[], eye: Eye): void {
    const marks = own.flatMap((measure, i) => measure.marks.map((mark, k) => ({ mark, i, k })));
    while (this.handles_.length > marks.length) this.handles_.pop()!.remove();
    while (this.handles_.length < marks.length) {
      const handle = this.make_handle();
      this.handles_.push(handle);
      this.host_.append(handle);
    }
    for (const [n, { mark, i, k }] of marks.entries()) {
      const handle = this.handles_[n]!;
      handle.dataset['measure'] = String(i);
      handle.dataset['mark'] = String(k);
      const name = text.measure.mark({ n: number(k + 1), name: this.parts_.name_of(i) });
      if (handle.ariaLabel !== name) handle.setAttribute('aria-label', name);
      const at = this.is_dragged(i, k) ? this.dragged_!.at : this.px_of(mark.point, eye);
      const [width, height] = this.size;
      const inside = at && at[0] >= 0 && at[1] >= 0 && at[0] <= width && at[1] <= height;
      handle.hidden = !inside;
      if (inside)
        handle.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
    }
  }

  private make_handle(): HTMLButtonElement {
    const handle = make('button', { type: 'button', className: 'measure-mark', hidden: true });
    const which = (): Pick<Dragged, 'measure' | 'mark'> => ({
      measure: Number(handle.dataset['measure']),
      mark: Number(handle.dataset['mark']),
    });
    let down: Point | undefined;
    handle.addEventListener('pointerdown', (event) => {
      if (event.button !== 0) return;
      down = this.place_of(event);
      handle.setPointerCapture(event.pointerId);
      this.parts_.list.choose(which().measure);
    });
    handle.addEventListener('pointermove', (event) => {
      if (!down) return;
      const at = this.place_of(event);
      if (!this.dragged_ && Math.hypot(at[0] - down[0], at[1] - down[1]) < still_px) return;
      this.drag({ ...which(), at });
    });
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'] as const)
      handle.addEventListener(end, () => {
        down = undefined;
        const { dragged_: dragged } = this;
        if (dragged) void this.put(dragged).then(() => this.let_go(dragged));
      });
    handle.addEventListener('focus', () => this.parts_.list.choose(which().measure));
    handle.addEventListener('keydown', (event) => this.press(event, which()));
    // Whoever zooms where a mark is means the view.
    handle.addEventListener('wheel', (event) => {
      if (!this.parts_.view.dispatchEvent(new WheelEvent(event.type, event)))
        event.preventDefault();
    });
    return handle;
  }

  private place_of({ clientX, clientY }: PointerEvent): Point {
    const { left, top } = this.parts_.view.getBoundingClientRect();
    return [clientX - left, clientY - top];
  }

  private press(event: KeyboardEvent, which: Pick<Dragged, 'measure' | 'mark'>): void {
    const step = steps[event.key];
    const removes = event.key === 'Delete' || event.key === 'Backspace';
    if (!step && !removes) return;
    event.preventDefault();
    event.stopPropagation(); // the camera stays
    if (!step) return this.parts_.list.remove_mark(which.measure, which.mark);
    const mark = this.parts_.list.own[which.measure]?.marks[which.mark];
    const from = mark && this.px_of(mark.point, this.parts_.navigation.eye);
    if (!from || this.dragged_) return;
    const way = event.shiftKey ? 1 : key_step_px;
    const at: Point = [from[0] + way * step[0], from[1] + way * step[1]];
    void this.put({ ...which, at });
  }

  private drag(dragged: Dragged): void {
    this.dragged_ = dragged;
    this.draw(this.parts_.navigation.eye);
    if (this.asks_) return;
    this.asks_ = true;
    void this.put(dragged).finally(() => (this.asks_ = false));
  }

  private let_go(dragged: Dragged): void {
    if (this.dragged_ !== dragged) return;
    this.dragged_ = undefined;
    this.draw(this.parts_.navigation.eye);
  }

  /** The mark is now what is there in the scene. */
  private async put({ measure, mark, at }: Dragged): Promise<void> {
    const { list, navigation, nothing_there } = this.parts_;
    const before = list.own[measure]?.marks.length;
    const [width, height] = this.size;
    const hit = await navigation.hit_at(at[0] / width, at[1] / height);
    if (list.own[measure]?.marks.length !== before) return;
    if (hit) list.move(measure, mark, hit);
    else if (!this.dragged_ || this.dragged_.at === at) nothing_there();
  }
}

function label([x, y]: Point, written: string, kind = 'length'): SVGElement {
  const element = shape('text', { x, y });
  element.classList.add(kind);
  element.textContent = written;
  return element;
}

function shape(
  name: 'circle' | 'line' | 'text',
  attributes: Readonly<Record<string, number>>,
): SVGElement {
  const element = document.createElementNS(svg, name);
  for (const [key, value] of Object.entries(attributes))
    element.setAttribute(key, value.toFixed(1));
  return element;
}
