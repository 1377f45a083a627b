// The floor plan: a small map that follows the visitor, or the whole storey.
import type { KeptTexts } from '../base/browser_storage';
import { dot, forward, length, rotate, sub, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { kept_system } from '../measure/units';
import { by_id, icon, make, save_file } from '../page/dom';
import { number } from '../text/number';
import { text } from '../text/text';
import type { MeasureList } from '../tour/measure_list';
import type { Stop } from '../tour/tour';
import { clear_near } from '../walk/map_walker';
import { areas_of } from '../walk/rooms';
import { height_of } from '../walk/tiles';
import {
  cells_per_eye_height,
  positions_at,
  storey_at,
  to_grid,
  type Stand,
  type WalkMap,
} from '../walk/walk_map';
import { stand_below } from '../walk/walker';
import type { Dollhouse } from './dollhouse';
import {
  draw_areas,
  draw_floor,
  draw_scale_bar,
  type DrawnPlan,
  type PlanScale,
} from './plan_drawing';
import { plan_picture, type PlanPicture } from './plan_picture';
import { area_of_storey, notes_of, plan_png } from './plan_sheet';
import { cells_of, px_of, type PlanView } from './plan_view';
import './floor_plan.css';

const up_key = 'catgs.plan.up';
const small_cells = 14 * cells_per_eye_height; // across the small map
const margin_cells = 4;
const dot_px = 6;
const cone_px = 34;
const font_px = 12;
const unknown = '#c7cfd9';
const accent = '#1f6feb';
const participant_colour = '#b3477d';

interface PlanParts {
  readonly storage: KeptTexts;
  /** The visitor has chosen a point on the floor. */
  readonly go_to: (stand: Stand) => void;
  readonly go_to_stop: (index: number) => void;
  /** Undefined: the scene is no house. */
  readonly dollhouse: Dollhouse | undefined;
  /** Where somebody would stand whose eyes are here. */
  readonly stand_at: (position: Vec3) => Stand;
  readonly measures: Pick<MeasureList, 'metres_per_unit'>;
  /** For files. */
  readonly scene_name: string;
}

export class PlanPanel {
  private readonly host_ = by_id('plan-panel', HTMLElement);
  private readonly canvas_ = make('canvas', { role: 'img', 'aria-label': text.floor_plan.title });
  private readonly picture_ = make('div', { className: 'plan-picture', dir: 'ltr' });
  private readonly spots_ = make('div', {
    className: 'plan-stops',
    role: 'group',
    'aria-label': text.page.stops,
  });
  private readonly storeys_ = make('select', { 'aria-label': text.floor_plan.storey });
  private readonly view_up_ = make(
    'button',
    { type: 'button', title: text.floor_plan.view_up, 'aria-label': text.floor_plan.view_up },
    icon('compass'),
  );
  private readonly house_ = make(
    'button',
    { type: 'button', title: text.floor_plan.dollhouse, 'aria-label': text.floor_plan.dollhouse },
    icon('dollhouse'),
  );
  private readonly print_ = make(
    'button',
    {
      type: 'button',
      className: 'plan-print',
      title: text.floor_plan.print,
      'aria-label': text.floor_plan.print,
    },
    icon('print'),
  );
  private readonly size_ = make('button', { type: 'button' });
  private readonly words_ = make('p');
  private readonly pictures_ = new Map<number, DrawnPlan | 'comes'>();
  private storey_ = 0;
  private visitors_storey_: number | undefined;
  private stops_: readonly { stop: Stop; stand: Stand; button: HTMLButtonElement }[] = [];
  private participants_: readonly Vec3[] = [];
  private eye_: Eye;
  private drawn_: PlanView | undefined;
  private due_ = false;

  constructor(
    private readonly parts_: PlanParts,
    private readonly map_: WalkMap,
    eye: Eye,
  ) {
    this.eye_ = eye;
    this.picture_.append(this.canvas_, this.spots_);
    this.host_.replaceChildren(
      this.picture_,
      this.words_,
      make(
        'div',
        { className: 'row' },
        this.storeys_,
        this.print_,
        this.house_,
        this.view_up_,
        this.size_,
      ),
    );
    this.storeys_.hidden = map_.storeys.length < 2;
    this.storeys_.append(
      ...map_.storeys
        .map((_, k) => new Option(text.floor_plan.storey_numbered({ n: k + 1 }), String(k)))
        .reverse(),
    );
    this.storeys_.addEventListener('change', () => {
      this.choose_storey(Number(this.storeys_.value));
      if (parts_.dollhouse?.shown) parts_.dollhouse.show(this.storey_);
    });
    this.view_up_.setAttribute('aria-pressed', String(parts_.storage.getItem(up_key) === 'view'));
    this.view_up_.addEventListener('click', () => {
      const view_up = this.view_up_.getAttribute('aria-pressed') !== 'true';
      this.view_up_.setAttribute('aria-pressed', String(view_up));
      parts_.storage.setItem(up_key, view_up ? 'view' : 'north');
      this.draw_soon();
    });
    this.size_.addEventListener('click', () => this.set_large(!this.is_large));
    this.print_.addEventListener('click', () => void this.print());
    this.bind_dollhouse(parts_.dollhouse);
    this.canvas_.addEventListener('click', ({ offsetX, offsetY }) =>
      this.clicked(offsetX, offsetY),
    );
    new ResizeObserver(() => this.draw_soon()).observe(this.picture_);
    this.canvas_.addEventListener('contextrestored', () => {
      this.pictures_.clear(); // the GPU has lost them, too
      this.draw_soon();
    });
    this.set_large(false);
    this.choose_storey(0);
    this.move(eye);
  }

  /** The camera of the picture is here now. */
  move(eye: Eye): void {
    this.eye_ = eye;
    if (this.host_.hidden) return;
    if (this.parts_.dollhouse?.shown) return this.draw_soon(); // the storey is the one that is shown
    this.visit_storey(eye.position);
    this.draw_soon();
  }

  show_stops(stops: readonly Stop[], current: number | undefined): void {
    const is_new =
      stops.length !== this.stops_.length || stops.some((stop, i) => stop !== this.stops_[i]?.stop);
    if (is_new) this.make_stops(stops);
    for (const [i, { button }] of this.stops_.entries()) {
      if (i === current) button.setAttribute('aria-current', 'step');
      else button.removeAttribute('aria-current');
    }
    this.draw_soon();
  }

  private make_stops(stops: readonly Stop[]): void {
    this.stops_ = stops.map((stop, i) => {
      const title = stop.title || text.tour.stop_numbered({ n: i + 1 });
      const button = make(
        'button',
        { type: 'button', className: 'plan-stop', hidden: true, title, 'aria-label': title },
        number(i + 1),
      );
      button.addEventListener('click', () => this.parts_.go_to_stop(i));
      return { stop, stand: this.parts_.stand_at(stop.eye.position), button };
    });
    this.spots_.replaceChildren(...this.stops_.map(({ button }) => button));
  }

  /** The scale of the scene or the visitor's units have changed. */
  show_scale(): void {
    this.draw_soon();
  }

  /** Where the eyes of other visitors are, in the world. */
  show_participants(positions: readonly Vec3[]): void {
    this.participants_ = positions;
    this.draw_soon();
  }

  private bind_dollhouse(house: Dollhouse | undefined): void {
    this.house_.hidden = !house;
    this.house_.setAttribute('aria-pressed', String(house?.shown ?? false));
    if (!house) return;
    this.house_.addEventListener('click', () => {
      if (house.shown) house.leave();
      else house.show(this.storey_);
    });
    house.changed.listen((shown) => this.house_.setAttribute('aria-pressed', String(shown)));
  }

  private get is_large(): boolean {
    return this.host_.classList.contains('large');
  }

  private set_large(large: boolean): void {
    this.host_.classList.toggle('large', large);
    this.size_.replaceChildren(icon(large ? 'small' : 'full'));
    this.size_.title = large ? text.floor_plan.smaller : text.floor_plan.larger;
    this.size_.setAttribute('aria-label', this.size_.title);
    this.draw_soon();
  }

  /** The plan shows the storey that the visitor comes to. Where no floor is below, it stays. */
  private visit_storey(position: Vec3): void {
    const stand =
      stand_below(this.map_, position) ??
      (this.visitors_storey_ === undefined ? this.parts_.stand_at(position) : undefined);
    const storey = stand && storey_at(this.map_, stand.height);
    if (storey === undefined || storey === this.visitors_storey_) return;
    this.visitors_storey_ = storey;
    this.choose_storey(storey);
  }

  private choose_storey(storey: number): void {
    this.storey_ = storey;
    this.storeys_.value = String(storey);
    this.draw_soon();
  }

  private clicked(x: number, y: number): void {
    if (!this.drawn_) return;
    const [east, north] = cells_of(this.drawn_, x, y);
    for (const point of [
      ...positions_at(this.map_, Math.floor(east), Math.floor(north)),
    ].reverse()) {
      const height = height_of(point);
      if (storey_at(this.map_, height) !== this.storey_) continue;
      const stand = clear_near(this.map_, { east, north, height });
      if (stand) return this.parts_.go_to(stand);
    }
  }

  private draw_soon(): void {
    if (this.due_ || this.host_.hidden) return;
    this.due_ = true;
    requestAnimationFrame(() => {
      this.due_ = false;
      this.draw();
    });
  }

  private picture_of(storey: number): DrawnPlan | undefined {
    const known = this.pictures_.get(storey);
    if (!known)
      this.make_picture(storey).catch((error: unknown) =>
        console.warn('the plan cannot be drawn', error),
      );
    return known === 'comes' ? undefined : known;
  }

  private async make_picture(storey: number): Promise<void> {
    this.pictures_.set(storey, 'comes');
    const [picture, areas] = await Promise.all([
      plan_picture(this.map_, storey),
      areas_of(this.map_, storey, this.parts_.dollhouse !== undefined),
    ]);
    const canvas = make('canvas', { width: picture.width, height: picture.height });
    canvas
      .getContext('2d')
      ?.putImageData(new ImageData(picture.rgba, picture.width, picture.height), 0, 0);
    this.pictures_.set(storey, { picture, canvas, areas });
    this.draw_soon();
  }

  private heading_rad(): number {
    const view = rotate(this.eye_.orientation, forward);
    return Math.atan2(dot(view, this.map_.axes[0]), dot(view, this.map_.axes[1]));
  }

  /** What part of the map the plan shows. */
  private view_of({ east, north, cells, width, height }: PlanPicture): PlanView {
    const { clientWidth: width_px, clientHeight: height_px } = this.canvas_;
    const up_rad = this.view_up_.getAttribute('aria-pressed') === 'true' ? this.heading_rad() : 0;
    if (!this.is_large) {
      const [x, y] = to_grid(this.map_, this.eye_.position);
      const px_per_cell = Math.min(width_px, height_px) / small_cells;
      return { east: x, north: y, px_per_cell, up_rad, width_px, height_px };
    }
    const [wide, deep] = [width * cells, height * cells];
    const [c, s] = [Math.abs(Math.cos(up_rad)), Math.abs(Math.sin(up_rad))];
    const px_per_cell = Math.min(
      width_px / (wide * c + deep * s + 2 * margin_cells),
      height_px / (wide * s + deep * c + 2 * margin_cells),
    );
    return {
      east: east + wide / 2,
      north: north + deep / 2,
      px_per_cell,
      up_rad,
      width_px,
      height_px,
    };
  }

  private draw(): void {
    const { canvas_: canvas } = this;
    const context = canvas.getContext('2d');
    const { clientWidth: width_px, clientHeight: height_px } = canvas;
    if (!context || width_px === 0) return;
    const ratio = window.devicePixelRatio;
    canvas.width = Math.round(width_px * ratio);
    canvas.height = Math.round(height_px * ratio);
    context.fillStyle = unknown;
    context.fillRect(0, 0, canvas.width, canvas.height);
    const made = this.picture_of(this.storey_);
    this.picture_.setAttribute('aria-busy', String(!made));
    if (!made) {
      this.words_.textContent = text.floor_plan.drawing;
      return;
    }
    const view = this.view_of(made.picture);
    this.drawn_ = view;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw_floor(context, made, view);
    if (this.is_large) draw_areas(context, made, view, this.scale, font_px);
    draw_scale_bar(context, view, this.scale, font_px);
    const area = area_of_storey(made.areas.cells, this.scale);
    this.words_.textContent = [area, ...notes_of(this.scale)].join(' · ');
    for (const position of this.participants_)
      if (this.is_beside(position)) this.draw_dot(context, view, position, participant_colour);
    if (this.storey_ === this.visitors_storey_) this.draw_visitor(context, view);
    this.place_stops(view);
  }

  private get scale(): PlanScale {
    const { measures, storage } = this.parts_;
    const { metres_per_unit } = measures;
    return { metres_per_unit, system: kept_system(storage), cell: this.map_.cell };
  }

  private async print(): Promise<void> {
    const plan = this.picture_of(this.storey_);
    if (!plan) return; // it is not drawn yet
    const storey = text.floor_plan.storey_numbered({ n: this.storey_ + 1 });
    const png = await plan_png(plan, storey, this.scale);
    if (png) save_file(png, `${this.parts_.scene_name}-${this.storey_ + 1}.png`);
  }

  /** Whether somebody's eyes there are in this storey, and not where the visitor is. */
  private is_beside(position: Vec3): boolean {
    const [, , height] = to_grid(this.map_, position);
    const apart_cells = length(sub(position, this.eye_.position)) / this.map_.cell;
    return storey_at(this.map_, height) === this.storey_ && apart_cells >= cells_per_eye_height;
  }

  private draw_visitor(context: CanvasRenderingContext2D, view: PlanView): void {
    const [east, north] = to_grid(this.map_, this.eye_.position);
    const [x, y] = px_of(view, east, north);
    const ahead = this.heading_rad() - view.up_rad - Math.PI / 2; // from the right, clockwise
    const half = Math.atan((Math.tan(this.eye_.fov_y_rad / 2) * innerWidth) / innerHeight);
    const light = context.createRadialGradient(x, y, 0, x, y, cone_px);
    light.addColorStop(0, 'rgb(31 111 235 / 60%)');
    light.addColorStop(1, 'rgb(31 111 235 / 0%)');
    context.fillStyle = light;
    context.beginPath();
    context.moveTo(x, y);
    context.arc(x, y, cone_px, ahead - half, ahead + half);
    context.fill();
    this.draw_dot(context, view, this.eye_.position, accent);
  }

  private draw_dot(
    context: CanvasRenderingContext2D,
    view: PlanView,
    position: Vec3,
    colour: string,
  ): void {
    const [east, north] = to_grid(this.map_, position);
    context.beginPath();
    context.arc(...px_of(view, east, north), dot_px, 0, 2 * Math.PI);
    context.fillStyle = colour;
    context.fill();
    context.lineWidth = 2;
    context.strokeStyle = '#fff';
    context.stroke();
  }

  private place_stops(view: PlanView): void {
    for (const { stop, stand, button } of this.stops_) {
      const [east, north] = to_grid(this.map_, stop.eye.position);
      const [x, y] = px_of(view, east, north);
      const inside = x >= 0 && y >= 0 && x <= view.width_px && y <= view.height_px;
      button.hidden = !inside || storey_at(this.map_, stand.height) !== this.storey_;
      button.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
    }
  }
}
