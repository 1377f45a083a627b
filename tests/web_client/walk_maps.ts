// Maps to walk on.
import { first_of, read_walk_file, type WalkMap } from '#client/walk/walk_map';
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

/** A map in the world as it is read of a file: all at one height, where `clear` says so. */
export function flat_map(width: number, depth: number, clear: (x: number, y: number) => boolean): WalkMap {
  const counts = Uint8Array.from({ length: width * depth }, (_, c) => Number(clear(c % width, Math.floor(c / width))));
  const places = new Uint16Array(counts.reduce((sum, count) => sum + count, 0)).fill(160 << 2);
  return { ...map, width, depth, counts, first: first_of(counts), places };
}
