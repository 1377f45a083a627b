// What a plan of a storey shows, on the screen and on paper: the floor, the areas of rooms, and a scale bar.
import { bar_within, rough, type Scale } from '../measure/units';
import type { StoreyAreas } from '../walk/rooms';
import type { PlanPicture } from './plan_picture';
import { px_of, type PlanView } from './plan_view';

const bar_share = 0.3; // of the width, at most
const ink = '#12161c';
const paper = 'rgb(255 255 255 / 80%)';

export const font_of = (px: number, weight: number): string =>
  [weight, `${px}px`, 'system-ui'].join(' ');

/** A plan that has been drawn once. */
export interface DrawnPlan {
  readonly picture: PlanPicture;
  readonly canvas: HTMLCanvasElement;
  readonly areas: StoreyAreas;
}

/** How long a cell is, and in which units lengths are written. */
export interface PlanScale extends Scale {
  readonly cell: number; // world units
}

/** Length in the world and its square as people read them. */
export const area_text = (cells: number, { cell, ...scale }: PlanScale): string =>
  rough(cells * cell ** 2, scale, 2);

export function draw_floor(
  context: CanvasRenderingContext2D,
  { picture, canvas }: DrawnPlan,
  view: PlanView,
): void {
  context.save();
  const scale = view.px_per_cell * picture.cells;
  context.imageSmoothingEnabled = scale * context.getTransform().a < 1.5;
  const [left, top] = px_of(view, picture.east, picture.north + picture.height * picture.cells);
  context.translate(left, top);
  context.rotate(-view.up_rad);
  context.scale(scale, scale);
  context.drawImage(canvas, 0, 0);
  context.restore();
}

/** The area of each room where it is widest, if it is wide enough for it. `font_px`: the height of letters. */
export function draw_areas(
  context: CanvasRenderingContext2D,
  { areas }: DrawnPlan,
  view: PlanView,
  scale: PlanScale,
  font_px: number,
): void {
  context.save();
  context.font = font_of(font_px, 600);
  context.textAlign = 'center';
  context.textBaseline = 'middle';
  context.direction = 'ltr';
  for (const { east, north, radius, cells } of areas.rooms) {
    const text = area_text(cells, scale);
    if (context.measureText(text).width > 2 * radius * view.px_per_cell) continue;
    const [x, y] = px_of(view, east, north);
    context.lineWidth = font_px / 4;
    context.lineJoin = 'round';
    context.strokeStyle = paper;
    context.strokeText(text, x, y);
    context.fillStyle = ink;
    context.fillText(text, x, y);
  }
  context.restore();
}

/** In the lower left corner. */
export function draw_scale_bar(
  context: CanvasRenderingContext2D,
  view: PlanView,
  { cell, ...scale }: PlanScale,
  font_px: number,
): void {
  const most = (bar_share * view.width_px * cell) / view.px_per_cell;
  const { length, text } = bar_within(most, scale);
  const long_px = (length / cell) * view.px_per_cell;
  const [left, bottom] = [font_px, view.height_px - font_px];
  const tick = font_px / 3;
  context.save();
  context.font = font_of(font_px, 600);
  context.textAlign = 'center';
  context.textBaseline = 'bottom';
  context.direction = 'ltr';
  context.lineJoin = 'round';
  const line = (): void => {
    context.beginPath();
    context.moveTo(left, bottom - tick);
    context.lineTo(left, bottom);
    context.lineTo(left + long_px, bottom);
    context.lineTo(left + long_px, bottom - tick);
    context.stroke();
  };
  const [x, y] = [left + long_px / 2, bottom - tick];
  context.strokeStyle = paper;
  context.lineWidth = font_px / 3;
  line();
  context.strokeText(text, x, y);
  context.strokeStyle = context.fillStyle = ink;
  context.lineWidth = font_px / 8;
  line();
  context.fillText(text, x, y);
  context.restore();
}
