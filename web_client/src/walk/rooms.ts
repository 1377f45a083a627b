// The rooms of a storey and their areas, for the plan. Pure.
import { Yields } from '../base/yields';
import { height_of, Kind, kind_of } from './tiles';
import { block_around, positions_at, storey_at, type Block, type WalkMap } from './walk_map';

const door_cells = 12; // openings up to this width separate rooms: 1.2 m for people of 1.6 m
const least_cells = 200; // of a room: 2 m²
// Lengths of the chamfer distance: a step beside, and one across.
const beside = 3;
const across = 4;

export interface Room {
  /** Where it is widest: the middle of a cell. */
  readonly east: number;
  readonly north: number;
  /** How far the walls are from there, cells. */
  readonly radius: number;
  readonly cells: number; // columns of the map
}

export interface StoreyAreas {
  /** Columns with floor, also below furniture. */
  readonly cells: number;
  /** The largest first. */
  readonly rooms: readonly Room[];
}

/** `has_rooms`: the storey is one of a house. */
export async function areas_of(
  map: WalkMap,
  storey: number,
  has_rooms: boolean,
): Promise<StoreyAreas> {
  const in_storey = (position: number): boolean => storey_at(map, height_of(position)) === storey;
  const block = await block_around(map, in_storey);
  if (!block) return { cells: 0, rooms: [] };
  const floor = await floor_of(map, block, in_storey);
  const cells = floor.reduce((sum, is_floor) => sum + is_floor, 0);
  if (!has_rooms) return { cells, rooms: [] };
  const width = block.east - block.west + 2;
  const from_wall = await distances(floor, width);
  const rooms = await grown(floor, width, await cores(from_wall, width));
  return { cells, rooms: rooms_of(rooms, from_wall, width, block) };
}

/** 1 where a column has floor, with a border of nothing around the block. */
async function floor_of(
  map: WalkMap,
  { west, south, east, north }: Block,
  in_storey: (position: number) => boolean,
): Promise<Uint8Array> {
  const width = east - west + 2;
  const floor = new Uint8Array(width * (north - south + 2));
  const yields = new Yields();
  for (let row = south; row < north; ++row) {
    await yields.if_due();
    for (let column = west; column < east; ++column) {
      const top = positions_at(map, column, row).findLast(in_storey);
      if (top !== undefined && kind_of(top) !== Kind.obstacle)
        floor[(row - south + 1) * width + column - west + 1] = 1;
    }
  }
  return floor;
}

/** How far each column is from what is no floor: chamfer distance, 3 a cell. */
async function distances(floor: Uint8Array, width: number): Promise<Uint16Array> {
  const far = Uint16Array.from(floor, (is_floor) => is_floor * 0xfff0);
  const yields = new Yields();
  const shorten = (at: number, way: 1 | -1): void => {
    if (far[at] === 0) return;
    const [near, line] = [at - way, at - way * width];
    far[at] = Math.min(
      far[at]!,
      far[near]! + beside,
      far[line]! + beside,
      far[line - 1]! + across,
      far[line + 1]! + across,
    );
  };
  for (let at = 0; at < far.length; ++at) {
    if (at % width === 0) await yields.if_due();
    shorten(at, 1);
  }
  for (let at = far.length - 1; at >= 0; --at) {
    if (at % width === 0) await yields.if_due();
    shorten(at, -1);
  }
  return far;
}

/** Numbers what is connected where no door would be wide enough: a room each, from 1. */
async function cores(from_wall: Uint16Array, width: number): Promise<Uint16Array> {
  const rooms = new Uint16Array(from_wall.length);
  const is_core = (at: number): boolean => from_wall[at]! > (door_cells / 2) * beside;
  const yields = new Yields();
  let count = 0;
  for (let first = 0; first < rooms.length && count < 0xffff; ++first) {
    if (first % width === 0) await yields.if_due();
    if (rooms[first] !== 0 || !is_core(first)) continue;
    rooms[first] = ++count;
    const open = [first];
    for (let at = open.pop(); at !== undefined; at = open.pop())
      for (const next of [at - 1, at + 1, at - width, at + width])
        if (rooms[next] === 0 && is_core(next)) {
          rooms[next] = count;
          open.push(next);
        }
  }
  return rooms;
}

/** All floor belongs to the room that is nearest. */
async function grown(floor: Uint8Array, width: number, rooms: Uint16Array): Promise<Uint16Array> {
  const yields = new Yields();
  let edge: number[] = [];
  rooms.forEach((room, at) => {
    if (room !== 0) edge.push(at);
  });
  while (edge.length > 0) {
    await yields.if_due();
    const wider: number[] = [];
    for (const at of edge)
      for (const next of [at - 1, at + 1, at - width, at + width])
        if (floor[next] === 1 && rooms[next] === 0) {
          rooms[next] = rooms[at]!;
          wider.push(next);
        }
    edge = wider;
  }
  return rooms;
}

function rooms_of(
  rooms: Uint16Array,
  from_wall: Uint16Array,
  width: number,
  { west, south }: Block,
): readonly Room[] {
  const found = new Map<number, { cells: number; widest: number }>();
  rooms.forEach((room, at) => {
    if (room === 0) return;
    const known = found.get(room);
    if (!known) return void found.set(room, { cells: 1, widest: at });
    known.cells += 1;
    if (from_wall[at]! > from_wall[known.widest]!) known.widest = at;
  });
  return [...found.values()]
    .filter(({ cells }) => cells >= least_cells)
    .map(({ cells, widest }) => ({
      east: west + (widest % width) - 0.5,
      north: south + Math.floor(widest / width) - 0.5,
      radius: from_wall[widest]! / beside,
      cells,
    }))
    .sort((a, b) => b.cells - a.cells);
}
