// The tiles of a walk file: how they are unpacked, kept, and refused.
import { deflateSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import { column_in_tile, height_of, Kind, kind_of, PackedTiles, tile_at } from '#client/walk/tiles';

/** The index and the tiles, packed. */
function packed(
  tiles: readonly (readonly number[])[],
  unpacked = tiles.map((bytes) => bytes.length),
): Uint8Array {
  const streams = tiles.map((bytes) =>
    bytes.length > 0 ? deflateSync(Uint8Array.from(bytes)) : Buffer.alloc(0),
  );
  const index = new Uint32Array(streams.flatMap((stream, t) => [stream.length, unpacked[t]!]));
  return Uint8Array.from(Buffer.concat([Buffer.from(index.buffer), ...streams]));
}

const zigzag = (d: number): number[] => [((2 * d) & 127) | 128, d >> 6];

/** Six columns of a place each at 10 cells, but the last one has none and the first one two. */
const six = [
  ...[2, 1, 1, 1, 1, 0],
  ...[0, 3, 0, 1, 2, 0],
  ...zigzag(160),
  ...zigzag(200),
  0,
  0,
  0,
  0,
];

describe('a tile', () => {
  it('has the places of its columns', () => {
    const tiles = new PackedTiles(3, 2, 6, packed([six]));
    const { first, positions } = tiles.at(0);
    expect([...first]).toEqual([0, 2, 3, 4, 5, 6, 6]);
    expect([...positions].map(height_of)).toEqual([10, 12.5, 10, 10, 10, 10]);
    expect([...positions].map(kind_of)).toEqual([
      Kind.clear,
      Kind.obstacle,
      Kind.clear,
      Kind.near,
      Kind.low,
      Kind.clear,
    ]);
    expect(column_in_tile(tiles, 1, 1)).toBe(4);
  });

  it.each([
    ['a column', [65, ...six.slice(1), ...Array<number>(130).fill(0)]],
    ['a place', six.map((byte, k) => (k === 6 ? 4 : byte))],
    ['a place', [...six.slice(0, 14), ...zigzag(100), 0, 0, 0, 0]],
    ['a place', six.map((byte, k) => (k === 12 ? 1 : byte))],
    ['heights', six.slice(0, -1)],
    ['heights', [...six.slice(0, 12), ...Array<number>(12).fill(128)]],
    ['a tile', [...six, 0]],
    ['a tile', six.slice(0, 5)],
    ['a tile', six.slice(0, 8)],
  ])('is refused: %s', (field, bytes) => {
    expect(() => new PackedTiles(3, 2, 2, packed([bytes])).at(0)).toThrow(
      `walk file: ${field} is out of range`,
    );
  });

  it('is refused where it has more or less than the index says, or is no stream', () => {
    for (const size of [six.length - 1, six.length + 1])
      expect(() => new PackedTiles(3, 2, 6, packed([six], [size])).at(0)).toThrow('a tile');
    const broken = packed([six]);
    broken[8]! ^= 255;
    expect(() => new PackedTiles(3, 2, 6, broken).at(0)).toThrow('a tile');
  });
});

describe('the tiles of a map', () => {
  const flat = (columns: number): number[] => [
    ...Array<number>(columns).fill(1),
    ...Array<number>(columns).fill(0),
    ...zigzag(160),
    ...Array<number>(columns - 1).fill(0),
  ];

  it('lie row by row, cut off at the east and the north', () => {
    const tiles = new PackedTiles(66, 65, 194, packed([[], flat(2 * 64), flat(64), flat(2)]));
    expect([0, 1, 2, 3].map((t) => tiles.has(t))).toEqual([false, true, true, true]);
    expect([0, 1, 2, 3].map((t) => tiles.at(t).positions.length)).toEqual([0, 128, 64, 2]);
    expect(tile_at(tiles, 65, 63)).toBe(1);
    expect(column_in_tile(tiles, 65, 63)).toBe(127);
    expect(tile_at(tiles, 65, 64)).toBe(3);
    expect(column_in_tile(tiles, 65, 64)).toBe(1);
  });

  it('are kept while others are not used more', () => {
    const tiles = new PackedTiles(
      64 * 30,
      1,
      64 * 30,
      packed(Array.from({ length: 30 }, () => flat(64))),
    );
    const [first, second] = [tiles.at(0), tiles.at(1)];
    for (let t = 2; t < 21; ++t) {
      tiles.at(t);
      expect(tiles.at(0)).toBe(first);
    }
    expect(tiles.at(1)).not.toBe(second);
    expect(tiles.at(1)).toEqual(second);
  });

  it('are all checked before one is used', async () => {
    const tiles = [flat(64), flat(64), [...flat(64), 0]];
    await expect(new PackedTiles(64 * 3, 1, 64 * 3, packed(tiles)).check()).rejects.toThrow(
      'a tile',
    );
    tiles[2]!.pop();
    await expect(
      new PackedTiles(64 * 3, 1, 64 * 3, packed(tiles)).check(),
    ).resolves.toBeUndefined();
    await expect(new PackedTiles(64 * 3, 1, 64 * 3 - 1, packed(tiles)).check()).rejects.toThrow(
      'places',
    );
  });

  it('are refused where the index is not theirs, without memory for what it names', () => {
    const right = packed([six]);
    for (const [at, value] of [
      [0, 4],
      [0, 500],
      [4, 0],
      [4, 2 ** 31],
    ] as const) {
      const forged = right.slice();
      new DataView(forged.buffer).setUint32(at, value, true);
      expect(() => new PackedTiles(3, 2, 6, forged)).toThrow('index');
    }
    expect(() => new PackedTiles(3, 2, 2 ** 24, right)).toThrow('places');
    expect(
      () => new PackedTiles(3, 2, 6, packed([Array<number>(600).fill(0)], [200])),
    ).not.toThrow();
    expect(() => new PackedTiles(3, 2, 6, packed([six], [0]))).toThrow('index');
    expect(() => new PackedTiles(3, 2, 6, right.slice(0, 7))).toThrow('index');
    expect(() => new PackedTiles(3, 2, 6, Uint8Array.from([...right, 0]))).toThrow('index');
  });
});
