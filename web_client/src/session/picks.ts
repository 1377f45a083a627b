import type { Timers } from '../base/clock';
import { add, scale, type Vec3 } from '../base/vector';
import type { Ray } from '../camera/ray';

const patience_ms = 2000; // the server answers only a few a second

/** Asks the server how far away the scene is along a ray. */
export class Picks {
  private asked_ = 0;
  private readonly waiting_ = new Map<number, (distance: number | undefined) => void>();

  constructor(
    private readonly ask_: (id: number, ray: Ray) => void,
    private readonly timers_: Timers,
  ) {}

  /** The point that the ray meets; undefined where it meets nothing, or where no answer comes. */
  async at(ray: Ray): Promise<Vec3 | undefined> {
    const id = ++this.asked_;
    const distance = await new Promise<number | undefined>((resolve) => {
      const cancel = this.timers_.after(patience_ms, () => this.answered(id, undefined));
      this.waiting_.set(id, (answer) => {
        cancel();
        resolve(answer);
      });
      this.ask_(id, ray);
    });
    return distance === undefined ? undefined : add(ray.origin, scale(ray.direction, distance));
  }

  answered(id: number, distance: number | undefined): void {
    this.waiting_.get(id)?.(distance);
    this.waiting_.delete(id);
  }
}
