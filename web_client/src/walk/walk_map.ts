// The walkable area of a scene: a `.walk` file (render_core/walk/walk_file.h).
import { Yields } from '../base/yields';
import { crc32 } from '../base/crc32';
import { add, cross, dot, scale, sub, type Vec3 } from '../base/vector';
import {
  column_in_tile,
  height_of,
  Kind,
  kind_of,
  most_levels,
  PackedTiles,
  require,
  tile_at,
  tile_side,
  type Tiles,
} from './tiles';

const plain_header_bytes = 320;
const origin_bytes = 24; // of the scene: three doubles behind the header of version 3
const most_side = 2048;
const most_positions = 2 ** 24;
const most_storeys = 16;
const most_person_cells = 160;
const most_bytes = 2 ** 27; // of a file
export const cells_per_eye_height = 16;

/** Where a walker stands: east, north and height of the ground, in cells. */
export interface Stand {
  readonly east: number;
  readonly north: number;
  readonly height: number;
}

/** A floor of a building, or all of a terrain: the positions from `low` up to the next storey's. Cells. */
export interface Storey {
  readonly low: number;
  readonly level: number; // the height of most of its ground
  readonly area: number; // clear cells
}

export interface WalkMap {
  readonly origin: Vec3; // the position of (0, 0, 0), in the coordinates of the scene's file
  readonly axes: readonly [east: Vec3, north: Vec3, up: Vec3]; // unit vectors of the world
  readonly cell: number; // world units
  readonly step: number; // cells; the highest step up or down
  readonly radius: number; // cells; of a body
  readonly chest: number; // cells; what is lower is furniture, not a wall
  readonly start: Stand;
  readonly storeys: readonly Storey[]; // from below
  readonly tiles: Tiles; // its columns, to the east, and its rows, to the north
}

export const to_grid = (map: WalkMap, point: Vec3): Vec3 => {
  const from_origin = sub(point, map.origin);
  const [east, north, up] = map.axes;
  const inverse = 1 / map.cell;
  return [
    dot(from_origin, east) * inverse,
    dot(from_origin, north) * inverse,
    dot(from_origin, up) * inverse,
  ];
};

/** Grid coordinates in the world; `height` counts up from the lowest cell. */
export function to_world(map: WalkMap, { east, north, height }: Stand): Vec3 {
  const [x, y, up] = map.axes;
  const flat = add(scale(x, east * map.cell), scale(y, north * map.cell));
  return add(map.origin, add(flat, scale(up, height * map.cell)));
}

/** The visitor's eyes in the world. */
export const eyes_of = (map: WalkMap, at: Stand): Vec3 =>
  to_world(map, { ...at, height: at.height + cells_per_eye_height });

/** The index in `storeys` of a height. */
export function storey_at(map: WalkMap, height: number): number {
  let storey = 0;
  while (storey + 1 < map.storeys.length && height >= map.storeys[storey + 1]!.low) ++storey;
  return storey;
}

const holds = ({ width, depth }: Tiles, column: number, row: number): boolean =>
  column >= 0 && row >= 0 && column < width && row < depth;

/** The positions of a column ascend. Outside of the map there are none. */
export function positions_at({ tiles }: WalkMap, column: number, row: number): Uint16Array {
  if (!holds(tiles, column, row)) return no_positions;
  const { first, positions } = tiles.at(tile_at(tiles, column, row));
  const c = column_in_tile(tiles, column, row);
  return positions.subarray(first[c], first[c + 1]);
}
const no_positions = new Uint16Array(0);

/** The clear ground of a column within a step of `height`; -1 where there is none. */
export function clear_at(
  { tiles, step }: WalkMap,
  column: number,
  row: number,
  height: number,
): number {
  if (!holds(tiles, column, row)) return -1;
  const { first, positions } = tiles.at(tile_at(tiles, column, row));
  const c = column_in_tile(tiles, column, row);
  const i = clear_in(positions, first[c]!, first[c + 1]!, height, step);
  return i < 0 ? -1 : positions[i]!;
}

/** The index of the clear ground within a step of `height` among the positions of a column; -1 where there is none. */
export function clear_in(
  positions: Uint16Array,
  begin: number,
  end: number,
  height: number,
  step: number,
): number {
  for (let i = begin; i < end; ++i)
    if (
      kind_of(positions[i]!) === Kind.clear &&
      Math.abs(height_of(positions[i]!) - height) <= step
    )
      return i;
  return -1;
}

/** A part of a map: columns from `west` up to `east`, rows from `south` up to `north`. */
export interface Block {
  readonly west: number;
  readonly south: number;
  readonly east: number;
  readonly north: number;
}

/** The parts of a map that have positions, of one tile each. */
export function* blocks({ tiles }: WalkMap): Generator<Block> {
  const { width, depth } = tiles;
  for (let south = 0; south < depth; south += tile_side)
    for (let west = 0; west < width; west += tile_side)
      if (tiles.has(tile_at(tiles, west, south)))
        yield {
          west,
          south,
          east: Math.min(west + tile_side, width),
          north: Math.min(south + tile_side, depth),
        };
}

/** The smallest block around the columns with such positions; undefined: there are none. */
export async function block_around(
  map: WalkMap,
  such: (position: number) => boolean,
): Promise<Block | undefined> {
  let [west, south, east, north] = [Infinity, Infinity, 0, 0];
  const yields = new Yields();
  for (const block of blocks(map)) {
    await yields.if_due();
    if (block.west >= west && block.south >= south && block.east <= east && block.north <= north)
      continue;
    for (let row = block.south; row < block.north; ++row)
      for (let column = block.west; column < block.east; ++column) {
        if (!positions_at(map, column, row).some(such)) continue;
        [west, south] = [Math.min(west, column), Math.min(south, row)];
        [east, north] = [Math.max(east, column + 1), Math.max(north, row + 1)];
      }
  }
  return east > 0 ? { west, south, east, north } : undefined;
}

/** Throws an Error that names the field that is wrong, of the header or of any tile. Lets the page draw meanwhile. */
export async function read_walk_file(file: ArrayBuffer): Promise<WalkMap> {
  require(file.byteLength > plain_header_bytes && file.byteLength <= most_bytes, 'length');
  const view = new DataView(file);
  const word = (at: number): number => view.getUint32(at, true);
  const float = (at: number): number => view.getFloat32(at, true);
  const triple = (at: number): Vec3 => [float(at), float(at + 4), float(at + 8)];
  const magic = String.fromCharCode(...new Uint8Array(file, 0, 8));
  require(magic === 'catgswlk' && (word(8) === 2 || word(8) === 3), 'version');
  const header_bytes = plain_header_bytes + (word(8) === 3 ? origin_bytes : 0);
  require(file.byteLength > header_bytes, 'length');
  const double = (k: number): number =>
    word(8) === 3 ? view.getFloat64(plain_header_bytes + 8 * k, true) : 0;
  require(crc32(new Uint8Array(file, 16)) === word(12), 'checksum');
  const [width, depth] = [word(104), word(108)];
  require(width >= 1 && width <= most_side && depth >= 1 && depth <= most_side, 'size');
  require(word(112) <= most_positions, 'positions');
  require(word(116) === tile_side, 'tile side');
  require(word(120) === file.byteLength - header_bytes, 'packed bytes');
  const tiles = new PackedTiles(width, depth, word(112), new Uint8Array(file, header_bytes));
  const map: WalkMap = {
    origin: add(triple(16), [double(0), double(1), double(2)]),
    axes: [triple(28), triple(40), triple(52)],
    cell: float(64),
    radius: float(68) * cells_per_eye_height,
    step: float(76) * cells_per_eye_height,
    chest: float(84) * cells_per_eye_height,
    start: { east: float(92), north: float(96), height: float(100) },
    storeys: read_storeys(word(124), (k) => triple(128 + 12 * k), word),
    tiles,
  };
  require_sound(map);
  await tiles.check();
  return map;
}

function read_storeys(
  count: number,
  of: (k: number) => Vec3,
  word: (at: number) => number,
): readonly Storey[] {
  require(count >= 1 && count <= most_storeys, 'storeys');
  return Array.from({ length: count }, (_, k) => {
    const [low, level] = of(k);
    return { low, level, area: word(128 + 12 * k + 8) };
  });
}

function require_sound(map: WalkMap): void {
  const { origin, axes, cell, step, radius, chest, start, storeys } = map;
  require(origin.every(Number.isFinite), 'origin');
  const right_angles = axes.every((a, i) =>
    axes.every((b, k) => Math.abs(dot(a, b) - (i === k ? 1 : 0)) < 1e-3),
  );
  require(right_angles && dot(cross(axes[0], axes[1]), axes[2]) > 0, 'axes');
  require(cell > 0 && cell < Infinity, 'cell');
  require([step, radius, chest].every(
    (cells) => cells > 0 && cells <= most_person_cells,
  ), 'person');
  require(storeys.every(
    ({ low, level }, k) =>
      low >= (storeys[k - 1]?.low ?? 0) && low <= most_levels && level >= 0 && level <= most_levels,
  ), 'storeys');
  require(clear_at(map, Math.floor(start.east), Math.floor(start.north), start.height) >=
    0, 'start');
}
