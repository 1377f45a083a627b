import type { Timers } from '../base/clock';
import { add, scale, type Vec3 } from '../base/vector';
import type { Ray } from '../camera/ray';

const patience_ms = 2000; // the server does not answer more than some a second

/** What a ray meets: how far away it is, and how deep the surface is there. World units. */
export interface Hit {
  readonly distance: number;
  readonly spread: number;
}

interface Answer {
  readonly hit: Hit | undefined;
}

/** Asks the server what there is along a ray. */
export class Picks {
  private asked_ = 0;
  private readonly waiting_ = new Map<number, (answer: Answer | undefined) => void>();

  constructor(
    private readonly ask_: (id: number, ray: Ray) => void,
    private readonly timers_: Timers,
  ) {}

  /** The point that the ray meets; undefined where it meets nothing, or where no answer comes. */
  async at(ray: Ray): Promise<Vec3 | undefined> {
    const hit = await this.hit(ray);
    return hit && add(ray.origin, scale(ray.direction, hit.distance));
  }

  /** What the ray meets; undefined where it meets nothing, or where no answer comes. */
  async hit(ray: Ray): Promise<Hit | undefined> {
    return (await this.answer(ray))?.hit;
  }

  /** How far away what the ray meets is; Infinity: nothing; undefined: no answer comes. */
  async distance(ray: Ray): Promise<number | undefined> {
    const answer = await this.answer(ray);
    return answer && (answer.hit?.distance ?? Infinity);
  }

  answered(id: number, hit: Hit | undefined): void {
    this.end(id, { hit });
  }

  private answer(ray: Ray): Promise<Answer | undefined> {
    const id = ++this.asked_;
    return new Promise((resolve) => {
      const cancel = this.timers_.after(patience_ms, () => this.end(id, undefined));
      this.waiting_.set(id, (answer) => {
        cancel();
        resolve(answer);
      });
      this.ask_(id, ray);
    });
  }

  private end(id: number, answer: Answer | undefined): void {
    this.waiting_.get(id)?.(answer);
    this.waiting_.delete(id);
  }
}
