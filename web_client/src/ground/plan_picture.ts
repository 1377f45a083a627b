// The floor plan of a storey as a picture, in the colours of render_core/walk/plan.cpp.
import { Breaths } from '../base/breaths';
import { clear_at, count_at, first_at, height_of, Kind, kind_of, storey_at, type WalkMap } from '../walk/walk_map';

type Colour = readonly [number, number, number];

const colours: Readonly<Record<number, Colour>> = {
  [Kind.near]: [235, 235, 235],
  [Kind.low]: [153, 145, 133],
  [Kind.obstacle]: [41, 46, 56],
};
const shade = 77; // of ground as steep as a step a cell
const most_px = 1024;

/** `east`, `north`: of its lower left corner, cells; a pixel has `cells` of them. What is not known is clear. */
export interface PlanPicture {
  readonly east: number;
  readonly north: number;
  readonly cells: number;
  readonly width: number;
  readonly height: number;
  readonly rgba: Uint8ClampedArray<ArrayBuffer>; // north at the top
}

/** The part of the map that has places of a storey, as [east, north, width, depth]; undefined: it has none. */
function extent_of(map: WalkMap, storey: number): readonly [number, number, number, number] | undefined {
  if (map.storeys.length === 1) return [0, 0, map.width, map.depth];
  let [west, south, east, north] = [Infinity, Infinity, -1, -1];
  let place = 0;
  for (let c = 0; c < map.counts.length; ++c)
    for (let k = 0; k < map.counts[c]!; ++k, ++place) {
      if (storey_at(map, height_of(map, place)) !== storey) continue;
      const [column, row] = [c % map.width, Math.floor(c / map.width)];
      [west, south] = [Math.min(west, column), Math.min(south, row)];
      [east, north] = [Math.max(east, column), Math.max(north, row)];
    }
  return east < 0 ? undefined : [west, south, east + 1 - west, north + 1 - south];
}

/** Higher places cover lower ones. Of the cells of a pixel the darkest counts, so that no wall is lost. */
export async function plan_picture(map: WalkMap, storey: number): Promise<PlanPicture> {
  const [east, north, wide, deep] = extent_of(map, storey) ?? [0, 0, 1, 1];
  const cells = Math.ceil(Math.max(wide, deep) / most_px);
  const [width, height] = [Math.ceil(wide / cells), Math.ceil(deep / cells)];
  const rgba = new Uint8ClampedArray(4 * width * height);
  const breaths = new Breaths();
  for (let y = 0; y < deep; ++y) {
    await breaths.take();
    let place = first_at(map, east, north + y);
    for (let x = 0; x < wide; ++x) {
      const count = count_at(map, east + x, north + y);
      const top = top_of(map, storey, place, count);
      place += count;
      if (top < 0) continue;
      const [r, g, b] = colours[kind_of(map, top)] ?? lit(map, east + x, north + y, cells === 1 ? top : undefined);
      const at = 4 * ((height - 1 - Math.floor(y / cells)) * width + Math.floor(x / cells));
      if (rgba[at + 3] !== 0 && rgba[at]! <= r) continue;
      rgba[at] = r;
      rgba[at + 1] = g;
      rgba[at + 2] = b;
      rgba[at + 3] = 255;
    }
  }
  return { east, north, cells, width, height, rgba };
}

/** The highest place of the storey in a column; -1: it has none. */
function top_of(map: WalkMap, storey: number, first: number, count: number): number {
  for (let i = first + count - 1; i >= first; --i) if (storey_at(map, height_of(map, i)) === storey) return i;
  return -1;
}

const level: Colour = [255, 255, 255];

/** Clear ground is darker where it is steep. */
function lit(map: WalkMap, column: number, row: number, place: number | undefined): Colour {
  if (place === undefined) return level;
  const height = height_of(map, place);
  const rise = (x: number, y: number): number => {
    const beside = clear_at(map, column + x, row + y, height);
    return beside < 0 ? 0 : height_of(map, beside) - height;
  };
  const light = 255 - shade * Math.min(1, Math.hypot(rise(1, 0), rise(0, 1)));
  return [light, light, light];
}
