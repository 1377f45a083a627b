// The floor plan of a storey as a picture, in the colours of render_core/walk/plan.cpp.
import { Yields } from '../base/yields';
import { height_of, Kind, kind_of } from '../walk/tiles';
import {
  block_around,
  blocks,
  clear_at,
  positions_at,
  storey_at,
  type WalkMap,
} from '../walk/walk_map';

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

/** Higher places cover lower ones. Of the cells of a pixel the darkest counts, so that no wall is lost. */
export async function plan_picture(map: WalkMap, storey: number): Promise<PlanPicture> {
  const in_storey = (position: number): boolean => storey_at(map, height_of(position)) === storey;
  const { west, south, east, north } = (await block_around(map, in_storey)) ?? {
    west: 0,
    south: 0,
    east: 1,
    north: 1,
  };
  const cells = Math.ceil(Math.max(east - west, north - south) / most_px);
  const [width, height] = [Math.ceil((east - west) / cells), Math.ceil((north - south) / cells)];
  const rgba = new Uint8ClampedArray(4 * width * height);
  const yields = new Yields();
  for (const block of blocks(map)) {
    await yields.if_due();
    for (let row = block.south; row < block.north; ++row)
      for (let column = block.west; column < block.east; ++column) {
        const top = positions_at(map, column, row).findLast(in_storey);
        if (top === undefined) continue;
        const [r, g, b] =
          colours[kind_of(top)] ?? (cells === 1 ? lit(map, column, row, height_of(top)) : level);
        const at =
          4 *
          ((height - 1 - Math.floor((row - south) / cells)) * width +
            Math.floor((column - west) / cells));
        if (rgba[at + 3] !== 0 && rgba[at]! <= r) continue;
        rgba[at] = r;
        rgba[at + 1] = g;
        rgba[at + 2] = b;
        rgba[at + 3] = 255;
      }
  }
  return { east: west, north: south, cells, width, height, rgba };
}

const level: Colour = [255, 255, 255];

/** Clear ground is darker where it is steep. */
function lit(map: WalkMap, column: number, row: number, height: number): Colour {
  const rise = (x: number, y: number): number => {
    const beside = clear_at(map, column + x, row + y, height);
    return beside < 0 ? 0 : height_of(beside) - height;
  };
  const light = 255 - shade * Math.min(1, Math.hypot(rise(1, 0), rise(0, 1)));
  return [light, light, light];
}
