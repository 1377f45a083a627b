// Short paths on a WalkMap (A*, Hart, Nilsson and Raphael 1968), for a tap on a point to go to.
import { Yields } from '../base/yields';
import { column_in_tile, height_of, require, tile_at, tiles_in, type Tile } from './tiles';
import { clear_in, type Stand, type WalkMap } from './walk_map';
import { straight } from './walker';

const diagonal = Math.SQRT2;
const straight_on = 1.2; // weight of what is left of the way (Pohl 1970): the search takes a third of the time
const nodes_a_yield = 64;
const most_skipped = 256; // places that a straight line is tried over

/** A binary heap of places, the least cost first. */
class Heap {
  private readonly costs: number[] = [];
  private readonly positions: number[] = [];

  get empty(): boolean {
    return this.costs.length === 0;
  }

  push(cost: number, position: number): void {
    const { costs, positions } = this;
    let i = costs.push(cost) - 1;
    positions.push(position);
    for (let above = (i - 1) >> 1; i > 0 && costs[above]! > cost; above = (i - 1) >> 1) {
      costs[i] = costs[above]!;
      positions[i] = positions[above]!;
      i = above;
    }
    costs[i] = cost;
    positions[i] = position;
  }

  pop(): number {
    const { costs, positions } = this;
    const least = positions[0]!;
    const cost = costs.pop()!;
    const position = positions.pop()!;
    const n = costs.length;
    let i = 0;
    for (let below = 1; below < n; below = 2 * i + 1) {
      if (below + 1 < n && costs[below + 1]! < costs[below]!) ++below;
      if (costs[below]! >= cost) break;
      costs[i] = costs[below]!;
      positions[i] = positions[below]!;
      i = below;
    }
    if (n > 0) {
      costs[i] = cost;
      positions[i] = position;
    }
    return least;
  }
}

/** To the east, north, west and south. */
const sides = [
  [1, 0],
  [0, 1],
  [-1, 0],
  [0, -1],
] as const;

const State = { unseen: 0, open: 1, done: 2 } as const;

/** The places of a map as nodes of a graph, numbered as the search comes to their tiles. */
class Search {
  readonly state: Uint8Array;
  readonly cost: Float32Array; // the way from the start, cells
  readonly before: Uint32Array; // the node before it on this way
  private readonly column_: Uint32Array;
  private readonly position_: Uint16Array;
  private readonly first_: Int32Array; // node of each tile; -1: the search has not come to it
  private readonly known_: Tile[] = [];
  private nodes_ = 0;

  constructor(private readonly map_: WalkMap) {
    const { width, depth, count } = map_.tiles;
    this.state = new Uint8Array(count);
    this.cost = new Float32Array(count);
    this.before = new Uint32Array(count);
    this.column_ = new Uint32Array(count);
    this.position_ = new Uint16Array(count);
    this.first_ = new Int32Array(tiles_in(width, depth)).fill(-1);
  }

  /** The node of the clear ground of a column within a step of `height`; -1 where there is none. */
  node_at(column: number, row: number, height: number): number {
    const { tiles, step } = this.map_;
    if (column < 0 || row < 0 || column >= tiles.width || row >= tiles.depth) return -1;
    const t = tile_at(tiles, column, row);
    if (this.first_[t]! < 0) this.come_to(t);
    const { first, positions } = this.known_[t]!;
    const c = column_in_tile(tiles, column, row);
    const i = clear_in(positions, first[c]!, first[c + 1]!, height, step);
    if (i < 0) return -1;
    const node = this.first_[t]! + i;
    this.column_[node] = row * tiles.width + column;
    this.position_[node] = positions[i]!;
    return node;
  }

  column_of(node: number): number {
    return this.column_[node]! % this.map_.tiles.width;
  }

  row_of(node: number): number {
    return Math.floor(this.column_[node]! / this.map_.tiles.width);
  }

  height_of(node: number): number {
    return height_of(this.position_[node]!);
  }

  private come_to(t: number): void {
    const tile = this.map_.tiles.at(t);
    this.known_[t] = tile;
    this.first_[t] = this.nodes_;
    this.nodes_ += tile.positions.length;
    require(this.nodes_ <= this.state.length, 'places');
  }
}

/**
 * A way over the grid and its eight directions, with straight pieces between its turns. It is at most a fifth longer
 * than the shortest. It begins with `from`. Empty where there is none, or where it is not `wanted` any more. While the
 * search runs, it keeps the tiles that it came to, takes 15 bytes for each place of the map, and lets the page draw.
 */
export async function find_path(
  map: WalkMap,
  from: Stand,
  to: Stand,
  wanted = (): boolean => true,
): Promise<Stand[]> {
  const search = new Search(map);
  const { state, cost, before } = search;
  const goal = [Math.floor(to.east), Math.floor(to.north)] as const;
  const begin = search.node_at(Math.floor(from.east), Math.floor(from.north), from.height);
  const end = search.node_at(...goal, to.height);
  if (begin < 0 || end < 0) return [];
  if (begin === end) return [from, to];
  const open = new Heap();
  const reach = (node: number, x: number, y: number, gone: number, last: number): void => {
    if (state[node] === State.done || (state[node] === State.open && !(gone < cost[node]!))) return;
    state[node] = State.open;
    cost[node] = gone;
    before[node] = last;
    const [dx, dy] = [Math.abs(goal[0] - x), Math.abs(goal[1] - y)];
    const left = Math.max(dx, dy) + (diagonal - 1) * Math.min(dx, dy);
    open.push(gone + straight_on * left, node);
  };
  reach(begin, Math.floor(from.east), Math.floor(from.north), 0, begin);
  const beside = [-1, -1, -1, -1];
  const yields = new Yields();
  for (let k = 0; !open.empty && state[end] !== State.done; ++k) {
    if (k % nodes_a_yield === 0) {
      await yields.if_due();
      if (!wanted()) return [];
    }
    const node = open.pop();
    if (state[node] === State.done) continue;
    state[node] = State.done;
    const [column, row, height] = [
      search.column_of(node),
      search.row_of(node),
      search.height_of(node),
    ];
    for (let side = 0; side < 4; ++side) {
      const [x, y] = sides[side]!;
      beside[side] = search.node_at(column + x, row + y, height);
      if (beside[side]! >= 0) reach(beside[side]!, column + x, row + y, cost[node]! + 1, node);
    }
    // Around a corner only where both cells beside it are clear.
    for (let side = 0; side < 4; ++side) {
      if (beside[side]! < 0 || beside[(side + 1) & 3]! < 0) continue;
      const [x, y] = [
        sides[side]![0] + sides[(side + 1) & 3]![0],
        sides[side]![1] + sides[(side + 1) & 3]![1],
      ];
      const next = search.node_at(column + x, row + y, height);
      if (next >= 0) reach(next, column + x, row + y, cost[node]! + diagonal, node);
    }
  }
  if (state[end] !== State.done) return [];
  const path = [to];
  for (let node = end; node !== begin; ) {
    node = before[node]!;
    path.push({
      east: search.column_of(node) + 0.5,
      north: search.row_of(node) + 0.5,
      height: search.height_of(node),
    });
  }
  path[path.length - 1] = from;
  return with_straight_pieces(map, path.reverse(), yields);
}

/** Leaves out what a straight line passes. */
async function with_straight_pieces(
  map: WalkMap,
  path: readonly Stand[],
  yields: Yields,
): Promise<Stand[]> {
  const turns = [path[0]!];
  for (let at = 0; at + 1 < path.length; ) {
    await yields.if_due();
    let next = at + 1;
    for (
      let far = Math.min(path.length - 1, at + most_skipped);
      far > next;
      far = Math.floor((far + at) / 2)
    )
      if (straight(map, path[at]!, path[far]!)) next = far;
    turns.push(path[next]!);
    at = next;
  }
  return turns;
}
