// Maps to walk on.
import { tile_side, tiles_in, type Tile } from '#client/walk/tiles';
import { read_walk_file, type WalkMap } from '#client/walk/walk_map';
import golden from '../support/walk_golden.json';

/** Stairs up to a floor, beside walls (walk_golden_test.cpp). Units are metres, z is up. */
export const file = Uint8Array.from(Buffer.from(golden.file, 'hex'));
export const map = await read_walk_file(file.buffer);

/** Marsaglia's xorshift, 0…1. */
export function random_from(seed: number): () => number {
  let state = seed;
  return () => {
    state ^= state << 13;
    state ^= state >>> 17;
    state ^= state << 5;
    return (state >>> 0) / 2 ** 32;
  };
}

/** The tiles of columns with one place each where `clear` says so, all at the same height in cells. */
export function flat_tiles(
  width: number,
  depth: number,
  height: number,
  clear: (x: number, y: number) => boolean,
): WalkMap['tiles'] {
  const across = Math.ceil(width / tile_side);
  const made = Array.from({ length: tiles_in(width, depth) }, (_, t): Tile => {
    const [west, south] = [tile_side * (t % across), tile_side * Math.floor(t / across)];
    const first = [0];
    for (let y = south; y < Math.min(south + tile_side, depth); ++y)
      for (let x = west; x < Math.min(west + tile_side, width); ++x)
        first.push(first.at(-1)! + Number(clear(x, y)));
    return {
      first: Uint16Array.from(first),
      positions: new Uint16Array(first.at(-1)!).fill((16 * height) << 2),
    };
  });
  const count = made.reduce((sum, { positions }) => sum + positions.length, 0);
  return { width, depth, count, has: (t) => made[t]!.positions.length > 0, at: (t) => made[t]! };
}

/** A map in the world as it is read of a file: all at one height, where `clear` says so. */
export const flat_map = (
  width: number,
  depth: number,
  clear: (x: number, y: number) => boolean,
): WalkMap => ({
  ...map,
  tiles: flat_tiles(width, depth, 10, clear),
});
