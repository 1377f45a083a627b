// The columns of a WalkMap, unpacked where somebody needs them: a map of two million places takes its file's bytes.
import { unzlibSync } from 'fflate';
import { Yields } from '../base/yields';

const tile_bits = 6;
export const tile_side = 2 ** tile_bits; // columns
const most_in_column = 64;
export const most_levels = 1024; // cells
const per_cell = 16; // units of a stored height
const kept_tiles = 20;
const most_growth = 1032; // of deflate
const most_tile_bytes = tile_side ** 2 * (1 + 4 * most_in_column);

/** What a column has at a height: `clear` ground has room for a body all around. */
export const Kind = { clear: 0, near: 1, low: 2, obstacle: 3 } as const;

/** A place is a height and a kind: height << 2 | kind. */
export const height_of = (position: number): number => (position >> 2) / per_cell; // cells
export const kind_of = (position: number): number => position & 3;

/** The columns of a tile, row by row. */
export interface Tile {
  readonly first: Uint16Array | Uint32Array; // index of the first place of each column; one more at the end
  readonly positions: Uint16Array; // those of a column ascend
}

export interface Tiles {
  readonly width: number; // columns
  readonly depth: number;
  readonly count: number; // places
  /** Whether the tile has places. */
  has(index: number): boolean;
  at(index: number): Tile;
}

/** Of a column, inside of the map. */
export const tile_at = ({ width }: Tiles, column: number, row: number): number =>
  (row >> tile_bits) * Math.ceil(width / tile_side) + (column >> tile_bits);
export function column_in_tile({ width }: Tiles, column: number, row: number): number {
  const [x, y] = [column & (tile_side - 1), row & (tile_side - 1)];
  return y * Math.min(tile_side, width - (column - x)) + x;
}

export const tiles_in = (width: number, depth: number): number =>
  Math.ceil(width / tile_side) * Math.ceil(depth / tile_side);

export function require(right: boolean, field: string): void {
  if (!right) throw new Error(`walk file: ${field} is out of range`);
}

/** Throws an Error that names what is wrong. */
function read_tile(bytes: Uint8Array, columns: number): Tile {
  require(bytes.length >= columns, 'a tile');
  const count = bytes.subarray(0, columns).reduce((sum, n) => sum + n, 0);
  require(columns + count <= bytes.length, 'a tile');
  const first = new (count < 2 ** 16 ? Uint16Array : Uint32Array)(columns + 1);
  const positions = new Uint16Array(count);
  const last = new Int32Array(most_in_column); // by rank in a column
  let at = columns + count;
  let position = 0;
  for (let c = 0; c < columns; ++c) {
    const in_column = bytes[c]!;
    require(in_column <= most_in_column, 'a column');
    for (let k = 0; k < in_column; ++k, ++position) {
      let code = 0;
      for (let shift = 0, more = true; more; shift += 7) {
        require(at < bytes.length && shift < 21, 'heights');
        const byte = bytes[at++]!;
        code |= (byte & 127) << shift;
        more = byte >= 128;
      }
      const height = last[k]! + ((code >> 1) ^ -(code & 1));
      const kind = bytes[columns + position]!;
      require(height >= 0 && height < most_levels * per_cell && kind <= 3, 'a place');
      require(k === 0 || height > last[k - 1]!, 'a place');
      positions[position] = (height << 2) | kind;
      last[k] = height;
    }
    first[c + 1] = position;
  }
  require(at === bytes.length, 'a tile');
  return { first, positions };
}

const nothing: Tile = { first: new Uint16Array(tile_side ** 2 + 1), positions: new Uint16Array(0) };

/** The tiles of a file: its index and what is behind it. Keeps the last ones that were asked for. */
export class PackedTiles implements Tiles {
  private readonly begin_: Uint32Array; // of each tile, and the end
  private readonly unpacked_: Uint32Array;
  private readonly bytes_: Uint8Array;
  private readonly known_ = new Map<number, Tile>(); // the last one used is the last one
  private last_ = -1;
  private last_tile_ = nothing;

  /** Throws an Error where the index is not that of `bytes`. */
  constructor(
    readonly width: number,
    readonly depth: number,
    readonly count: number,
    bytes: Uint8Array,
  ) {
    const tiles = tiles_in(width, depth);
    require(bytes.length >= 8 * tiles, 'index');
    const index = new DataView(bytes.buffer, bytes.byteOffset, 8 * tiles);
    this.begin_ = new Uint32Array(tiles + 1);
    this.unpacked_ = new Uint32Array(tiles);
    this.bytes_ = bytes.subarray(8 * tiles);
    let sum = 0;
    for (let t = 0; t < tiles; ++t) {
      const [packed, unpacked] = [index.getUint32(8 * t, true), index.getUint32(8 * t + 4, true)];
      const end = this.begin_[t]! + packed;
      require(end <= this.bytes_.length && unpacked <= most_growth * packed, 'index');
      require(unpacked <= most_tile_bytes && packed <= 2 * unpacked + 64, 'index');
      require((packed === 0) === (unpacked === 0), 'index');
      sum += unpacked;
      this.begin_[t + 1] = end;
      this.unpacked_[t] = unpacked;
    }
    require(this.begin_[tiles] === this.bytes_.length, 'index');
    require(2 * count <= sum, 'places'); // a kind and a height each
  }

  /** Throws an Error where a tile cannot be read, so that at() never does. Lets the page draw meanwhile. */
  async check(): Promise<void> {
    const yields = new Yields();
    let count = 0;
    for (let t = 0; t < this.unpacked_.length; ++t) {
      await yields.if_due();
      count += this.unpack(t).positions.length;
    }
    require(count === this.count, 'places');
  }

  has(index: number): boolean {
    return this.unpacked_[index]! > 0;
  }

  at(index: number): Tile {
    if (index === this.last_) return this.last_tile_;
    const tile = this.known_.get(index) ?? this.unpack(index);
    this.known_.delete(index);
    this.known_.set(index, tile);
    if (this.known_.size > kept_tiles) this.known_.delete(this.known_.keys().next().value!);
    this.last_ = index;
    this.last_tile_ = tile;
    return tile;
  }

  private unpack(index: number): Tile {
    if (!this.has(index)) return nothing;
    const across = Math.ceil(this.width / tile_side);
    const wide = Math.min(tile_side, this.width - tile_side * (index % across));
    const deep = Math.min(tile_side, this.depth - tile_side * Math.floor(index / across));
    return read_tile(
      inflated(
        this.bytes_.subarray(this.begin_[index], this.begin_[index + 1]),
        this.unpacked_[index]!,
      ),
      wide * deep,
    );
  }
}

function inflated(packed: Uint8Array, bytes: number): Uint8Array {
  const out = new Uint8Array(bytes + 1); // so that more than the index says shows
  let size = -1;
  try {
    size = unzlibSync(packed, { out }).length;
  } catch {
    // the check below tells
  }
  require(size === bytes, 'a tile');
  return out.subarray(0, bytes);
}
