// Draws the section box over the picture, with a handle on each side that visitors drag.
import { add, dot, forward, rotate, scale, sub, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { project, visible_part } from '../camera/ray';
import {
  box_of,
  least_side,
  limited_side,
  section_of_box,
  upright_axes,
  type UprightBox,
} from '../camera/upright_box';
import { written_on_line, type Scale } from '../measure/units';
import { make } from '../page/dom';
import type { PageParts } from '../page/parts';
import { text } from '../text/text';

const svg = 'http://www.w3.org/2000/svg';
/** The sides: the axis that they are on, and which way it leads out of them. */
const sides = [
  { name: 'left', axis: 0, sign: -1 },
  { name: 'right', axis: 0, sign: 1 },
  { name: 'front', axis: 1, sign: -1 },
  { name: 'back', axis: 1, sign: 1 },
  { name: 'bottom', axis: 2, sign: -1 },
  { name: 'top', axis: 2, sign: 1 },
] as const;
type Side = (typeof sides)[number];

const steps: Readonly<Record<string, number>> = {
  ArrowUp: 1,
  ArrowRight: 1,
  ArrowDown: -1,
  ArrowLeft: -1,
};
const key_step_px = 8;
const least_px = 0.12; // that a side moves in the picture, over what it would at a right angle

type Point = readonly [x: number, y: number];

/** The box with one side moved outwards. World units. */
export function with_side(
  box: UprightBox,
  { axis, sign }: Pick<Side, 'axis' | 'sign'>,
  by: number,
  up: Vec3,
  least: number,
): UprightBox {
  const length = limited_side(Math.max(least, box.size[axis] + by));
  const moved = (sign * (length - box.size[axis])) / 2;
  const along = upright_axes(up, box.turn_rad)[axis];
  const size = box.size.map((v, i) => (i === axis ? length : v)) as unknown as Vec3;
  return { ...box, size, centre: add(box.centre, scale(along, moved)) };
}

export class SectionBox {
  private readonly lines_ = document.createElementNS(svg, 'svg');
  private readonly handles_: readonly { side: Side; element: HTMLElement }[];

  constructor(
    private readonly parts_: Pick<PageParts, 'view' | 'navigation' | 'clipping'>,
    private readonly scale_: () => Scale,
    before: HTMLElement,
  ) {
    this.lines_.id = 'section-lines';
    this.lines_.setAttribute('aria-hidden', 'true');
    this.handles_ = sides.map((side) => ({ side, element: this.make_handle(side) }));
    const elements = this.handles_.map(({ element }) => element);
    before.before(this.lines_, make('div', { id: 'section-handles' }, ...elements));
  }

  draw(box: UprightBox | undefined, eye: Eye): void {
    const edges = box ? edges_of(box, this.up) : [];
    const [width, height] = this.size;
    this.lines_.replaceChildren(
      ...edges.flatMap(([from, to]) => {
        const part = visible_part(from, to, eye, width / height);
        if (!part) return [];
        const line = document.createElementNS(svg, 'line');
        part.forEach(([x, y], i) => {
          line.setAttribute(`x${i + 1}`, (x * width).toFixed(1));
          line.setAttribute(`y${i + 1}`, (y * height).toFixed(1));
        });
        return [line];
      }),
    );
    for (const { side, element } of this.handles_) {
      const at = box && this.handle_at(box, side, eye);
      element.hidden = !at;
      if (!at) continue;
      element.style.transform = `translate(${at[0].toFixed(1)}px, ${at[1].toFixed(1)}px)`;
      const length = box.size[side.axis];
      element.setAttribute('aria-valuenow', length.toPrecision(4));
      element.setAttribute(
        'aria-valuetext',
        written_on_line({ value: length, error: 0 }, this.scale_()),
      );
    }
  }

  private get up(): Vec3 {
    return this.parts_.navigation.camera.up;
  }

  private get size(): Point {
    const { clientWidth, clientHeight } = this.parts_.view;
    return [clientWidth, Math.max(1, clientHeight)];
  }

  private px_of(point: Vec3, eye: Eye): Point | undefined {
    const [width, height] = this.size;
    const at = project(point, eye, width / height);
    return at && [at[0] * width, at[1] * height];
  }

  /** Where the handle is; undefined: outside of the view, or its side moves along the line of sight. */
  private handle_at(box: UprightBox, side: Side, eye: Eye): Point | undefined {
    const middle = middle_of(box, side, this.up);
    const at = this.px_of(middle, eye);
    const [width, height] = this.size;
    const inside = at && at[0] >= 0 && at[1] >= 0 && at[0] <= width && at[1] <= height;
    if (!inside) return undefined;
    const out = upright_axes(this.up, box.turn_rad)[side.axis];
    const sight =
      eye.view_height === undefined ? sub(middle, eye.position) : rotate(eye.orientation, forward);
    const cosine = dot(out, sight) / Math.hypot(...sight);
    return Math.sqrt(Math.max(0, 1 - cosine * cosine)) > least_px ? at : undefined;
  }

  /** How the handle moves in the view where its side moves outwards. px per world unit. */
  private px_per_unit(box: UprightBox, side: Side, eye: Eye): Point {
    const out = scale(upright_axes(this.up, box.turn_rad)[side.axis], side.sign);
    const middle = middle_of(box, side, this.up);
    const step = 1e-3 * box.size[side.axis];
    const [a, b] = [this.px_of(middle, eye), this.px_of(add(middle, scale(out, step)), eye)];
    return a && b ? [(b[0] - a[0]) / step, (b[1] - a[1]) / step] : [0, 0];
  }

  private move(box: UprightBox, side: Side, by_px: Point): void {
    const { clipping, navigation } = this.parts_;
    const [x, y] = this.px_per_unit(box, side, navigation.eye);
    const square = x * x + y * y;
    if (!(square > 0)) return;
    const by = (by_px[0] * x + by_px[1] * y) / square;
    const least = least_side(navigation.reach);
    clipping.edit(section_of_box(with_side(box, side, by, this.up, least)));
  }

  private make_handle(side: Side): HTMLElement {
    const element = make('div', { className: 'section-handle', tabIndex: 0, hidden: true });
    element.setAttribute('role', 'slider');
    element.setAttribute('aria-valuemin', '0');
    element.setAttribute('aria-valuemax', '1000000000'); // it has none
    element.setAttribute('aria-label', text.views.side({ side: text.views[side.name] }));
    let from: { readonly box: UprightBox; readonly at: Point } | undefined;
    const box_now = (): UprightBox | undefined => {
      const { section } = this.parts_.clipping;
      return section && box_of(section);
    };
    element.addEventListener('pointerdown', (event) => {
      const box = box_now();
      if (event.button !== 0 || !box) return;
      from = { box, at: [event.clientX, event.clientY] };
      element.setPointerCapture(event.pointerId);
    });
    element.addEventListener('pointermove', ({ clientX, clientY }) => {
      if (from) this.move(from.box, side, [clientX - from.at[0], clientY - from.at[1]]);
    });
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'] as const)
      element.addEventListener(end, () => (from = undefined));
    element.addEventListener('keydown', (event) => {
      const step = steps[event.key];
      const box = box_now();
      if (!step || !box) return;
      event.preventDefault();
      event.stopPropagation(); // the camera stays
      const [x, y] = this.px_per_unit(box, side, this.parts_.navigation.eye);
      const way = (step * (event.shiftKey ? 1 : key_step_px)) / Math.max(1e-9, Math.hypot(x, y));
      this.move(box, side, [x * way, y * way]);
    });
    // Whoever zooms where a handle is means the view.
    element.addEventListener('wheel', (event) => {
      if (!this.parts_.view.dispatchEvent(new WheelEvent(event.type, event)))
        event.preventDefault();
    });
    return element;
  }
}

function middle_of({ centre, size, turn_rad }: UprightBox, side: Side, up: Vec3): Vec3 {
  const out = upright_axes(up, turn_rad)[side.axis];
  return add(centre, scale(out, (side.sign * size[side.axis]) / 2));
}

function edges_of({ centre, size, turn_rad }: UprightBox, up: Vec3): (readonly [Vec3, Vec3])[] {
  const axes = upright_axes(up, turn_rad);
  const corner = (bits: number): Vec3 =>
    axes
      .map((axis, i) => scale(axis, (size[i]! / 2) * ((bits >> i) & 1 ? 1 : -1)))
      .reduce(add, centre);
  return [0, 1, 2].flatMap((axis) =>
    [0, 1, 2, 3, 4, 5, 6, 7]
      .filter((bits) => ((bits >> axis) & 1) === 0)
      .map((bits) => [corner(bits), corner(bits | (1 << axis))] as const),
  );
}
