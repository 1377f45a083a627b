// The plan of a storey on a sheet of paper, as a picture that prints at its size.
import { crc32 } from '../base/crc32';
import type { System } from '../measure/units';
import { make } from '../page/dom';
import { number } from '../text/number';
import { text } from '../text/text';
import {
  area_text,
  draw_areas,
  draw_floor,
  draw_scale_bar,
  font_of,
  type DrawnPlan,
  type PlanScale,
} from './plan_drawing';
import type { PlanView } from './plan_view';

const px_per_mm = 12; // 305 dots an inch
const margin_mm = 12;
const words_mm = 22; // below the plan
const font_px = 3.5 * px_per_mm;
const sheets = {
  metric: { name: 'A4', mm: [210, 297] },
  imperial: { name: 'Letter', mm: [215.9, 279.4] },
} as const;
const unknown = '#e4e8ed'; // paler than on the screen, for the ink
const denominators = [10, 20, 25, 50, 75, 100, 150, 200, 250, 500, 1000, 2000, 5000];

export interface Sheet {
  readonly name: string;
  readonly width_px: number;
  readonly height_px: number;
  /** The part for the plan, between margins and words. */
  readonly inner: readonly [width_px: number, height_px: number];
  readonly px_per_cell: number;
  /** A metre is 1/denominator on the paper; undefined where nobody knows the scale. */
  readonly denominator: number | undefined;
}

/** A sheet for so many cells: upright or across, at a usual scale where it fits one. Pure. */
export function sheet_for(wide: number, deep: number, scale: PlanScale): Sheet {
  const system: System = scale.system;
  const { name, mm } = sheets[system];
  const [width_mm, height_mm] = wide > deep ? [mm[1], mm[0]] : [mm[0], mm[1]];
  const inner_mm = [width_mm - 2 * margin_mm, height_mm - 2 * margin_mm - words_mm] as const;
  const most = Math.min(inner_mm[0] / wide, inner_mm[1] / deep); // mm of paper a cell
  const cell_mm = scale.metres_per_unit && scale.cell * scale.metres_per_unit * 1000;
  const denominator = cell_mm && denominators.find((n) => cell_mm / n <= most);
  return {
    name,
    width_px: Math.round(width_mm * px_per_mm),
    height_px: Math.round(height_mm * px_per_mm),
    inner: [inner_mm[0] * px_per_mm, inner_mm[1] * px_per_mm],
    px_per_cell: px_per_mm * (denominator ? cell_mm / denominator : most),
    denominator: denominator || undefined,
  };
}

/** Undefined: the browser has no memory for it. */
export async function plan_png(
  plan: DrawnPlan,
  storey: string,
  scale: PlanScale,
): Promise<Blob | undefined> {
  const { picture, areas } = plan;
  const [wide, deep] = [picture.width * picture.cells, picture.height * picture.cells];
  const sheet = sheet_for(wide, deep, scale);
  const canvas = make('canvas', { width: sheet.width_px, height: sheet.height_px });
  const context = canvas.getContext('2d');
  if (!context) return undefined;
  context.fillStyle = '#fff';
  context.fillRect(0, 0, canvas.width, canvas.height);
  const [width_px, height_px] = sheet.inner;
  const view: PlanView = {
    east: picture.east + wide / 2,
    north: picture.north + deep / 2,
    px_per_cell: sheet.px_per_cell,
    up_rad: 0,
    width_px,
    height_px,
  };
  context.translate(margin_mm * px_per_mm, margin_mm * px_per_mm);
  context.fillStyle = unknown;
  context.fillRect(0, 0, width_px, height_px);
  draw_floor(context, plan, view);
  draw_areas(context, plan, view, scale, font_px);
  context.translate(0, words_mm * px_per_mm * 0.4);
  draw_scale_bar(context, view, scale, font_px);
  write_words(context, view, [
    [storey, area_of_storey(areas.cells, scale), ratio_of(sheet)].filter(Boolean).join(' · '),
    ...notes_of(scale),
  ]);
  const blob = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve));
  if (!blob) return undefined;
  return new Blob([with_resolution(new Uint8Array(await blob.arrayBuffer()))], {
    type: 'image/png',
  });
}

export const area_of_storey = (cells: number, scale: PlanScale): string =>
  text.floor_plan.area({ area: area_text(cells, scale) });

/** What readers of a plan must know. Without a scale, its numbers are no metres. */
export const notes_of = ({ metres_per_unit }: PlanScale): readonly string[] => [
  text.floor_plan.sketch,
  ...(metres_per_unit ? [] : [text.measure.no_scale]),
];

const ratio_of = ({ denominator, name }: Sheet): string =>
  denominator
    ? text.floor_plan.ratio({
        ratio: `1:${number(denominator, { useGrouping: false })}`,
        paper: name,
      })
    : '';

function write_words(
  context: CanvasRenderingContext2D,
  { width_px, height_px }: PlanView,
  lines: readonly string[],
): void {
  const is_rtl = document.documentElement.dir === 'rtl';
  context.direction = is_rtl ? 'rtl' : 'ltr';
  context.textAlign = 'start';
  context.textBaseline = 'top';
  context.fillStyle = '#12161c';
  context.font = font_of(font_px, 400);
  for (const [i, line] of lines.entries())
    context.fillText(line, is_rtl ? width_px : 0, height_px + i * 1.4 * font_px, width_px);
}

const signature_and_header = 8 + 25; // bytes of a PNG before other chunks may come

/** The same PNG with the resolution of the paper, so that programs print it at its size. Pure. */
export function with_resolution(png: Uint8Array): Uint8Array<ArrayBuffer> {
  const chunk = new Uint8Array(21);
  const view = new DataView(chunk.buffer);
  view.setUint32(0, 9);
  chunk.set([0x70, 0x48, 0x59, 0x73], 4); // "pHYs"
  view.setUint32(8, px_per_mm * 1000);
  view.setUint32(12, px_per_mm * 1000);
  chunk[16] = 1; // a metre
  view.setUint32(17, crc32(chunk.subarray(4, 17)));
  const out = new Uint8Array(png.length + chunk.length);
  out.set(png.subarray(0, signature_and_header));
  out.set(chunk, signature_and_header);
  out.set(png.subarray(signature_and_header), signature_and_header + chunk.length);
  return out;
}
