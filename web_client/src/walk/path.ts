// Shortest paths on a WalkMap (A*, Hart, Nilsson and Raphael 1968), for a tap on a place to go to.
import { clear_at, height_of, type Stand, type WalkMap } from './walk_map';
import { straight } from './walker';

const diagonal = Math.SQRT2;
const most_skipped = 256; // places that a straight line is tried over

/** A binary heap of places, the least cost first. */
class Heap {
  private readonly costs: number[] = [];
  private readonly places: number[] = [];

  get empty(): boolean {
    return this.costs.length === 0;
  }

  push(cost: number, place: number): void {
    let i = this.costs.push(cost) - 1;
    this.places.push(place);
    for (let above = (i - 1) >> 1; i > 0 && this.cost(above) > this.cost(i); above = (i - 1) >> 1) {
      this.swap(i, above);
      i = above;
    }
  }

  pop(): number {
    const least = this.places[0]!;
    this.swap(0, this.costs.length - 1);
    this.costs.pop();
    this.places.pop();
    for (let i = 0; ; ) {
      let below = 2 * i + 1;
      if (this.cost(below + 1) < this.cost(below)) ++below;
      if (!(this.cost(below) < this.cost(i))) return least;
      this.swap(i, below);
      i = below;
    }
  }

  private cost(i: number): number {
    return this.costs[i] ?? Infinity;
  }

  private swap(a: number, b: number): void {
    [this.costs[a], this.costs[b]] = [this.cost(b), this.cost(a)];
    [this.places[a], this.places[b]] = [this.places[b]!, this.places[a]!];
  }
}

const neighbours = [-1, 0, 1].flatMap((y) => [-1, 0, 1].map((x) => [x, y] as const)).filter(([x, y]) => x !== 0 || y !== 0);

/**
 * A shortest way over the grid and its eight directions, with straight pieces between its turns. It begins
 * with `from`. Empty where there is none. Takes 12 bytes for each place of the map while it runs.
 */
export function find_path(map: WalkMap, from: Stand, to: Stand): Stand[] {
  const goal = [Math.floor(to.east), Math.floor(to.north)] as const;
  const begin = clear_at(map, Math.floor(from.east), Math.floor(from.north), from.height);
  const end = clear_at(map, ...goal, to.height);
  if (begin < 0 || end < 0) return [];
  if (begin === end) return [from, to];
  const cost = new Float32Array(map.places.length).fill(Infinity);
  const before = new Uint32Array(map.places.length);
  const column_of = new Uint32Array(map.places.length);
  const open = new Heap();
  const reach = (place: number, x: number, y: number, gone: number, last: number): void => {
    if (!(gone < cost[place]!)) return;
    cost[place] = gone;
    before[place] = last;
    column_of[place] = y * map.width + x;
    const [dx, dy] = [Math.abs(goal[0] - x), Math.abs(goal[1] - y)];
    const left = Math.max(dx, dy) + (diagonal - 1) * Math.min(dx, dy);
    open.push(cost[place] + left, place);
  };
  reach(begin, Math.floor(from.east), Math.floor(from.north), 0, begin);
  const done = new Uint8Array(map.places.length);
  while (!open.empty && !done[end]) {
    const place = open.pop();
    if (done[place]) continue;
    done[place] = 1;
    const [column, row] = [column_of[place]! % map.width, Math.floor(column_of[place]! / map.width)];
    const height = height_of(map, place);
    for (const [x, y] of neighbours) {
      const next = clear_at(map, column + x, row + y, height);
      const corner = x !== 0 && y !== 0;
      if (next < 0 || done[next]) continue;
      if (corner && (clear_at(map, column + x, row, height) < 0 || clear_at(map, column, row + y, height) < 0))
        continue;
      reach(next, column + x, row + y, cost[place]! + (corner ? diagonal : 1), place);
    }
  }
  if (!done[end]) return [];
  const path = [to];
  for (let place = end; place !== begin; ) {
    place = before[place]!;
    const [column, row] = [column_of[place]! % map.width, Math.floor(column_of[place]! / map.width)];
    path.push({ east: column + 0.5, north: row + 0.5, height: height_of(map, place) });
  }
  path[path.length - 1] = from;
  return with_straight_pieces(map, path.reverse());
}

/** Leaves out what a straight line passes. */
function with_straight_pieces(map: WalkMap, path: readonly Stand[]): Stand[] {
  const turns = [path[0]!];
  for (let at = 0; at + 1 < path.length; ) {
    let next = at + 1;
    for (let far = Math.min(path.length - 1, at + most_skipped); far > next; far = Math.floor((far + at) / 2))
      if (straight(map, path[at]!, path[far]!)) next = far;
    turns.push(path[next]!);
    at = next;
  }
  return turns;
}
