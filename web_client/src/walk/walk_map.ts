// The ground of a scene on which a visitor can walk: a `.walk` file (render_core/walk/walk_file.h).
import { Breaths } from '../base/breaths';
import { add, cross, dot, scale, sub, type Vec3 } from '../base/vector';

const header_bytes = 320;
const most_in_column = 64;
const most_side = 2048;
const most_places = 2 ** 24;
const most_storeys = 16;
const most_levels = 1024; // cells
const most_person_cells = 160;
const most_bytes = 2 ** 27; // of a file
const most_growth = 1032; // of deflate
const per_cell = 16; // units of a stored height
export const cells_per_eye_height = 16;

/** What a column has at a height: `clear` ground has room for a body all around. */
export const Kind = { clear: 0, near: 1, low: 2, obstacle: 3 } as const;

/** Where a walker stands: east, north and height of the ground, in cells. */
export interface Stand {
  readonly east: number;
  readonly north: number;
  readonly height: number;
}

/** A floor of a building, or all of a terrain: the places from `low` up to the next storey's. Cells. */
export interface Storey {
  readonly low: number;
  readonly level: number; // the height of most of its ground
  readonly area: number; // clear cells
}

export interface WalkMap {
  readonly origin: Vec3; // the world place of (0, 0, 0)
  readonly axes: readonly [east: Vec3, north: Vec3, up: Vec3]; // unit vectors of the world
  readonly cell: number; // world units
  readonly step: number; // cells; the highest step up or down
  readonly radius: number; // cells; of a body
  readonly chest: number; // cells; what is lower is furniture, not a wall
  readonly start: Stand;
  readonly storeys: readonly Storey[]; // from below
  readonly width: number; // columns to the east
  readonly depth: number; // rows to the north
  readonly counts: Uint8Array; // places of each column, row by row
  readonly first: Uint32Array; // index of the first place of each block of columns
  readonly places: Uint16Array; // height << 2 | kind; the places of a column ascend
}

const block = 16; // columns

/** The index of columns with so many places. */
export function first_of(counts: Uint8Array): Uint32Array {
  const first = new Uint32Array(Math.ceil(counts.length / block));
  let sum = 0;
  for (let c = 0; c < counts.length; ++c) {
    if (c % block === 0) first[c / block] = sum;
    sum += counts[c]!;
  }
  return first;
}

export const to_grid = (map: WalkMap, place: Vec3): Vec3 => {
  const from_origin = sub(place, map.origin);
  const [east, north, up] = map.axes;
  const inverse = 1 / map.cell;
  return [dot(from_origin, east) * inverse, dot(from_origin, north) * inverse, dot(from_origin, up) * inverse];
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

export const height_of = (map: WalkMap, place: number): number => (map.places[place]! >> 2) / per_cell;
export const kind_of = (map: WalkMap, place: number): number => map.places[place]! & 3;

/** The first place of a column; -1 outside of the map. Further ones follow, `count_at` in all. */
export function first_at(map: WalkMap, column: number, row: number): number {
  if (!(column >= 0 && row >= 0 && column < map.width && row < map.depth)) return -1;
  const c = row * map.width + column;
  let place = map.first[(c / block) | 0]!;
  for (let k = c - (c % block); k < c; ++k) place += map.counts[k]!;
  return place;
}

export const count_at = (map: WalkMap, column: number, row: number): number =>
  column >= 0 && column < map.width ? (map.counts[row * map.width + column] ?? 0) : 0;

/** The clear ground of a column within a step of `height`; -1 where there is none. */
export function clear_at(map: WalkMap, column: number, row: number, height: number): number {
  const first = first_at(map, column, row);
  if (first < 0) return -1;
  const end = first + map.counts[row * map.width + column]!;
  for (let i = first; i < end; ++i)
    if (kind_of(map, i) === Kind.clear && Math.abs(height_of(map, i) - height) <= map.step) return i;
  return -1;
}

function require(right: boolean, field: string): void {
  if (!right) throw new Error(`walk file: ${field} is out of range`);
}

/** CRC-32 of ISO 3309, four bits at a time. */
function crc32(bytes: Uint8Array): number {
  const table = new Uint32Array(16);
  for (let k = 0; k < 16; ++k) {
    let rest = k;
    for (let bit = 0; bit < 4; ++bit) rest = rest & 1 ? (rest >>> 1) ^ 0xedb88320 : rest >>> 1;
    table[k] = rest;
  }
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc = (crc >>> 4) ^ table[(crc ^ byte) & 15]!;
    crc = (crc >>> 4) ^ table[(crc ^ (byte >>> 4)) & 15]!;
  }
  return ~crc >>> 0;
}

async function unpacked(packed: Uint8Array<ArrayBuffer>, bytes: number): Promise<Uint8Array> {
  const out = new Uint8Array(bytes);
  let at = 0;
  const reader = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate')).getReader();
  for (let part = await reader.read(); !part.done; part = await reader.read()) {
    require(at + part.value.length <= bytes, 'stream');
    out.set(part.value, at);
    at += part.value.length;
  }
  require(at === bytes, 'stream');
  return out;
}

/** Throws an Error that names the field that is wrong. */
export async function read_walk_file(file: ArrayBuffer): Promise<WalkMap> {
  require(file.byteLength > header_bytes && file.byteLength <= most_bytes, 'length');
  const view = new DataView(file);
  const word = (at: number): number => view.getUint32(at, true);
  const float = (at: number): number => view.getFloat32(at, true);
  const triple = (at: number): Vec3 => [float(at), float(at + 4), float(at + 8)];
  const magic = String.fromCharCode(...new Uint8Array(file, 0, 8));
  require(magic === 'catgswlk' && word(8) === 1, 'version');
  require(crc32(new Uint8Array(file, 16)) === word(12), 'checksum');
  const [width, depth, count, bytes] = [word(104), word(108), word(112), word(116)];
  require(width >= 1 && width <= most_side && depth >= 1 && depth <= most_side, 'size');
  require(count <= most_places, 'places');
  require(bytes <= most_growth * file.byteLength && bytes <= width * depth + 4 * count, 'unpacked');
  require(bytes >= width * depth + 2 * count, 'unpacked');
  const map: WalkMap = {
    origin: triple(16),
    axes: [triple(28), triple(40), triple(52)],
    cell: float(64),
    radius: float(68) * cells_per_eye_height,
    step: float(76) * cells_per_eye_height,
    chest: float(84) * cells_per_eye_height,
    start: { east: float(92), north: float(96), height: float(100) },
    storeys: read_storeys(word(124), (k) => triple(128 + 12 * k), word),
    width,
    depth,
    ...(await read_places(await unpacked(new Uint8Array(file, header_bytes), bytes), width * depth, count)),
  };
  require_sound(map);
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
  require([step, radius, chest].every((cells) => cells > 0 && cells <= most_person_cells), 'person');
  require(
    storeys.every(({ low, level }, k) => low >= (storeys[k - 1]?.low ?? 0) && low <= most_levels && level >= 0 && level <= most_levels),
    'storeys',
  );
  require(clear_at(map, Math.floor(start.east), Math.floor(start.north), start.height) >= 0, 'start');
}

async function read_places(
  bytes: Uint8Array,
  columns: number,
  count: number,
): Promise<Pick<WalkMap, 'counts' | 'first' | 'places'>> {
  const counts = bytes.slice(0, columns);
  const places = new Uint16Array(count);
  const last = new Int32Array(most_in_column); // by rank in a column
  let at = columns + count;
  let place = 0;
  const breaths = new Breaths();
  for (let c = 0; c < columns; ++c) {
    if (c % 4096 === 0) await breaths.take();
    const in_column = counts[c]!;
    require(in_column <= most_in_column && place + in_column <= count, 'columns');
    for (let k = 0; k < in_column; ++k, ++place) {
      let code = 0;
      for (let shift = 0, more = true; more; shift += 7) {
        require(at < bytes.length && shift < 21, 'heights');
        const byte = bytes[at++]!;
        code |= (byte & 127) << shift;
        more = byte >= 128;
      }
      const height = last[k]! + ((code >> 1) ^ -(code & 1));
      const kind = bytes[columns + place]!;
      require(height >= 0 && height < most_levels * per_cell && kind <= 3, 'a place');
      require(k === 0 || height > last[k - 1]!, 'a place');
      places[place] = (height << 2) | kind;
      last[k] = height;
    }
  }
  require(place === count && at === bytes.length, 'columns');
  return { counts, first: first_of(counts), places };
}
