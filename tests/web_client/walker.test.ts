// The client's reader, walker and paths against those of render_core/walk (walk_golden_test.cpp).
import { describe, expect, it } from 'vitest';
import { sub, type Vec3 } from '#client/base/vector';
import { find_path } from '#client/walk/path';
import { tiles_in } from '#client/walk/tiles';
import {
  clear_at,
  eyes_of,
  read_walk_file,
  storey_at,
  type Stand,
  type WalkMap,
} from '#client/walk/walk_map';
import { move, stand_below, straight } from '#client/walk/walker';
import golden from '../support/walk_golden.json';
import { expect_vec } from './cameras';
import { file, flat_map, map, random_from } from './walk_maps';

const stand = ([east, north, height]: number[]): Stand => ({
  east: east!,
  north: north!,
  height: height!,
});

const is_clear = (on: WalkMap, { east, north, height }: Stand): boolean =>
  clear_at(on, Math.floor(east), Math.floor(north), height) >= 0;

const distance = (a: Stand, b: Stand): number => Math.hypot(a.east - b.east, a.north - b.north);

function seal(bytes: Uint8Array<ArrayBuffer>): ArrayBuffer {
  let crc = 0xffffffff;
  for (const byte of bytes.subarray(16)) {
    crc ^= byte;
    for (let k = 0; k < 8; ++k) crc = crc & 1 ? (crc >>> 1) ^ 0xedb88320 : crc >>> 1;
  }
  new DataView(bytes.buffer).setUint32(12, ~crc >>> 0, true);
  return bytes.buffer;
}

describe('a walk file', () => {
  it('has the ground of its scene', () => {
    expect(map.cell).toBeCloseTo(0.1, 6);
    expect(map.storeys).toHaveLength(2);
    expect(storey_at(map, stand(golden.below[1]!.stand).height)).toBe(1);
    expect(is_clear(map, map.start)).toBe(true);
  });

  it('lies in the coordinates of a file far from 0', async () => {
    const origin: Vec3 = [500123, 5412345, 431];
    const far = new Uint8Array(file.length + 24);
    far.set(file.subarray(0, 320));
    far.set(file.subarray(320), 344);
    const view = new DataView(far.buffer);
    view.setUint32(8, 3, true);
    origin.forEach((v, k) => view.setFloat64(320 + 8 * k, v, true));
    const there = await read_walk_file(seal(far));
    expect_vec(sub(there.origin, map.origin), origin, 6);
    expect(is_clear(there, there.start)).toBe(true);
  });

  it('is refused where it is cut off or changed', async () => {
    for (let size = 0; size < file.length; size += size < 330 ? 1 : 29)
      await expect(read_walk_file(file.slice(0, size).buffer)).rejects.toThrow('walk file');
    for (let k = 0; k < file.length; k += 3) {
      const changed = file.slice();
      changed[k]! ^= 16;
      await expect(read_walk_file(changed.buffer), String(k)).rejects.toThrow('walk file');
    }
  }, 60_000);

  it('whose tiles are forged behind the checksum is refused when it is read, or never', async () => {
    const tiles = tiles_in(map.tiles.width, map.tiles.depth);
    expect(tiles).toBeGreaterThan(1);
    let refused = 0;
    for (let k = 320 + 8 * tiles; k < file.length; ++k) {
      const changed = file.slice();
      changed[k]! ^= 1 << k % 8;
      const forged = await read_walk_file(seal(changed)).catch((error: unknown) => {
        expect(String(error)).toContain('walk file');
        ++refused;
        return undefined;
      });
      for (let t = 0; forged && t < tiles; ++t)
        expect(() => forged.tiles.at(t), String(k)).not.toThrow();
    }
    expect(refused).toBeGreaterThan(0);
  }, 60_000);

  it('is refused where its header or its index is forged', async () => {
    const forged = async (field: string, write: (view: DataView) => void): Promise<void> => {
      const changed = file.slice();
      write(new DataView(changed.buffer));
      await expect(read_walk_file(seal(changed)), field).rejects.toThrow(field);
    };
    await forged('version', (view) => view.setUint32(8, 1, true));
    await forged('origin', (view) => view.setFloat32(16, NaN, true));
    await forged('axes', (view) => view.setFloat32(28, 0.5, true));
    await forged('cell', (view) => view.setFloat32(64, 0, true));
    await forged('person', (view) => view.setFloat32(76, -1, true));
    await forged('start', (view) => view.setFloat32(92, 2000, true));
    await forged('size', (view) => view.setUint32(104, 5000, true));
    await forged('positions', (view) => view.setUint32(112, 0xffffffff, true));
    await forged('tile side', (view) => view.setUint32(116, 32, true));
    await forged('packed bytes', (view) =>
      view.setUint32(120, view.getUint32(120, true) - 1, true),
    );
    await forged('storeys', (view) => view.setUint32(124, 17, true));
    await forged('storeys', (view) => view.setFloat32(128, NaN, true));
    await forged('places', (view) => view.setUint32(112, view.getUint32(112, true) - 1, true));
    await forged('index', (view) => view.setUint32(320, view.getUint32(320, true) + 1, true));
  });
});

describe('a walker', () => {
  it('goes where the one of render_core goes', () => {
    expect(golden.moves.length).toBeGreaterThan(100);
    for (const { from, way, to } of golden.moves) {
      const { east, north, height } = move(map, stand(from), way[0]!, way[1]!);
      expect_vec([east, north, height], [to[0]!, to[1]!, to[2]!], 3);
    }
  });

  it('comes to stand where the one of render_core does', () => {
    for (const { place: position, stand: below, eyes } of golden.below) {
      const found = stand_below(map, [position[0]!, position[1]!, position[2]!])!;
      expect_vec([found.east, found.north, found.height], [below[0]!, below[1]!, below[2]!], 3);
      expect_vec(eyes_of(map, found), [eyes[0]!, eyes[1]!, eyes[2]!], 4);
    }
    expect(stand_below(map, [100, 0, 5])).toBeUndefined();
    expect(stand_below(map, [-1, 1, -5])).toBeUndefined();
  });

  it('slides along a wall and does not pass it', () => {
    const yard = flat_map(40, 40, (x, y) => x !== 20 || y >= 35);
    const head_on = move(yard, { east: 15.5, north: 5.5, height: 10 }, 10, 0);
    expect(head_on.east).toBeGreaterThan(19);
    expect(head_on.east).toBeLessThan(20);
    const aslant = move(yard, { east: 15.5, north: 5.5, height: 10 }, 10, 10);
    expect(aslant.east).toBeLessThan(20);
    expect(aslant.north).toBeGreaterThan(13);
  });

  it('never leaves clear ground in ten minutes', () => {
    const random = random_from(1);
    const debris = flat_map(60, 60, (x, y) => x + y < 5 || random() > 0.25);
    for (const ground of [map, debris]) {
      let at: Stand = ground === map ? map.start : { east: 0.5, north: 0.5, height: 10 };
      let [x, y] = [0, 0];
      let way = 0;
      for (let frame = 0; frame < 10 * 60 * 60; ++frame) {
        if (frame % 90 === 0) [x, y] = [random() - 0.5, random() - 0.5];
        const before = at;
        at = move(ground, at, x, y);
        way += distance(before, at);
        if (!is_clear(ground, at))
          throw new Error(`frame ${frame}: off the ground at ${JSON.stringify(at)}`);
        if (Math.abs(at.height - before.height) > ground.step)
          throw new Error(`frame ${frame}: fell`);
      }
      expect(way).toBeGreaterThan(500);
    }
  }, 60_000);
});

/** The shortest way over the grid from the first column to the last (Bellman and Ford); Infinity: there is none. */
function shortest_of(on: WalkMap): number {
  const { width, depth } = on.tiles;
  const way = new Map<number, number>([[0, 0]]);
  const clear = (x: number, y: number): boolean => clear_at(on, x, y, 10) >= 0;
  for (let changed = true; changed; ) {
    changed = false;
    for (const [at, gone] of [...way])
      for (const [x, y] of [
        [1, 0],
        [0, 1],
        [-1, 0],
        [0, -1],
        [1, 1],
        [-1, 1],
        [-1, -1],
        [1, -1],
      ] as const) {
        const [east, north] = [(at % width) + x, Math.floor(at / width) + y];
        if (!clear(east, north) || !clear(east - x, north) || !clear(east, north - y)) continue;
        const next = north * width + east;
        if (gone + Math.hypot(x, y) >= (way.get(next) ?? Infinity) - 1e-9) continue;
        way.set(next, gone + Math.hypot(x, y));
        changed = true;
      }
  }
  return way.get(width * depth - 1) ?? Infinity;
}

describe('a path', () => {
  it('is as long as that of render_core', async () => {
    for (const { from, to, length } of golden.paths) {
      const path = await find_path(map, stand(from), stand(to));
      expect(path[0]).toEqual(stand(from));
      expect(path.at(-1)).toEqual(stand(to));
      const steps = path.slice(1).map((at, k) => [path[k]!, at] as const);
      for (const [a, b] of steps) expect(straight(map, a, b)).toBe(true);
      const total = steps.reduce((sum, [a, b]) => sum + distance(a, b), 0);
      // Of ways that are as short over the grid, the straight pieces may differ.
      expect(Math.abs(total - length)).toBeLessThan(0.02 * length);
    }
  }, 60_000);

  it('leads around a wall, also into another tile', async () => {
    const yard = flat_map(100, 70, (x, y) => x !== 63 || y >= 35);
    const path = await find_path(
      yard,
      { east: 58.5, north: 5.5, height: 10 },
      { east: 68.5, north: 5.5, height: 10 },
    );
    const total = path.slice(1).reduce((sum, at, k) => sum + distance(path[k]!, at), 0);
    expect(total).toBeGreaterThan(59.5);
    expect(total).toBeLessThan(64);
  });

  it('is at most a fifth longer than the shortest', async () => {
    const random = random_from(5);
    for (let round = 0; round < 10; ++round) {
      const maze = flat_map(30, 24, (x, y) => x + y < 4 || x + y > 48 || random() > 0.3);
      const path = await find_path(
        maze,
        { east: 0.5, north: 0.5, height: 10 },
        { east: 29.5, north: 23.5, height: 10 },
      );
      const shortest = shortest_of(maze);
      expect(path.length > 0).toBe(shortest < Infinity);
      const total = path.slice(1).reduce((sum, at, k) => sum + distance(path[k]!, at), 0);
      expect(total).toBeLessThanOrEqual(1.2 * shortest);
    }
  }, 60_000);

  it('is not sought any further when nobody wants it', async () => {
    const yard = flat_map(40, 40, () => true);
    const [from, to] = [
      { east: 0.5, north: 0.5, height: 10 },
      { east: 39.5, north: 39.5, height: 10 },
    ];
    expect(await find_path(yard, from, to, () => false)).toEqual([]);
    expect(await find_path(yard, from, to, () => true)).toEqual([from, to]);
  });

  it('is none where there is no way', async () => {
    const parted = flat_map(40, 10, (x) => x !== 20);
    const at = (east: number): Stand => ({ east, north: 5.5, height: 10 });
    for (const [from, to] of [
      [5.5, 30.5],
      [5.5, 20.5],
      [-5.5, 5.5],
    ] as const)
      expect(await find_path(parted, at(from), at(to))).toEqual([]);
  });
});
