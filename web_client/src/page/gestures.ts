// Who hears what visitors do at a point of the view. Pure.
import type { Pointed } from '../input/pointers';

/** Returns whether it takes this; otherwise, the next one hears it. */
type Taker = (pointed: Pointed) => boolean;

/** From the first to the last. */
const order = ['point', 'measure', 'dollhouse', 'walk', 'look'] as const;
export type TakerName = (typeof order)[number];

export class GestureRouter {
  private readonly takers_ = new Map<TakerName, Taker>();

  set(name: TakerName, taker: Taker): void {
    this.takers_.set(name, taker);
  }

  remove(name: TakerName): void {
    this.takers_.delete(name);
  }

  has(name: TakerName): boolean {
    return this.takers_.has(name);
  }

  route(pointed: Pointed): void {
    for (const name of order) if (this.takers_.get(name)?.(pointed)) return;
  }
}
