// Where an orbiting camera may go: rays that were asked of the server say how far the way is clear. Pure.
import { add, dot, forward, length, normalize, scale, sub, type Vec3 } from '../base/vector';
import type { Ray } from './ray';

/** Asks how far away the surface is that a ray meets, world units; Infinity: it meets none; undefined: no answer. */
export type AskDistance = (ray: Ray) => Promise<number | undefined>;

const most_known = 16;
const asked_again = 0.5; // of what was asked: then the rest follows

/** A way that the camera wants to go. World units. */
export interface WantedWay {
  readonly from: Vec3;
  readonly to: Vec3;
  /** From `from` on: what is asked at once. */
  readonly ahead: Vec3;
  /** What is so near to a ray is as clear as the ray. */
  readonly width: number;
  /** The camera stays so far from what a ray meets. */
  readonly clearance: number;
  /**
   * A second ray begins so far behind, because a ray meets no surface that is all around its origin. 0: the camera
   * goes before the answer, and the second ray says whether it has passed anything.
   */
  readonly behind: number;
}

interface KnownWay extends Ray {
  readonly clear: number; // world units
  readonly asked: number; // likewise: as far as the camera was to go
  readonly width: number;
}

export class ClearPath {
  ask: AskDistance | undefined;
  private known_: KnownWay[] = [];
  private asks_ = false;
  private checked_: Vec3 | undefined; // the camera may be here
  private moved_unchecked_: Vec3 | undefined; // the camera went here before the answer
  private end_: Vec3 | undefined;

  /** The scene is another one. */
  forget(): void {
    this.known_ = [];
    this.checked_ = this.moved_unchecked_ = this.end_ = undefined;
  }

  /** Whether the camera may go there; undefined: it is not known yet, and is asked. */
  allows(want: WantedWay): boolean | undefined {
    const { ask } = this;
    if (!ask) return true;
    let blocked = false;
    for (const way of this.known_) {
      const width = Math.min(want.width, way.width);
      const along = along_of(way, want.to, width);
      if (along === undefined) continue;
      if (along <= way.clear - want.clearance) {
        if (along > asked_again * way.asked) this.ask_along(ask, want);
        return true;
      }
      const before = along_of(way, want.from, width);
      blocked ||= before !== undefined && before < along && before <= way.clear + width;
    }
    if (blocked) return false;
    this.ask_along(ask, want);
    return undefined;
  }

  /** The camera has gone there without an answer. */
  moved_unchecked(to: Vec3): void {
    this.moved_unchecked_ = to;
  }

  /** Where the camera goes back to, since something opaque is in between; undefined: nothing is. */
  take_back(): Vec3 | undefined {
    const end = this.end_;
    this.end_ = undefined;
    return end;
  }

  /** Asks what is ahead, and whether anything opaque lies between here and where it was asked last. */
  private ask_along(ask: AskDistance, want: WantedWay): void {
    if (this.asks_) return;
    this.asks_ = true;
    const { known_: known, checked_: checked } = this;
    const { from, ahead, width, clearance, behind } = want;
    const direction = normalize(ahead, forward);
    const come = checked ? sub(from, checked) : ahead;
    const is_near = checked && length(come) > 0 && length(come) <= 2 * length(ahead);
    const answered = (ahead_clear?: number, second?: number): void => {
      this.asks_ = false;
      if (known !== this.known_) return; // of another scene
      if (behind > 0 && (ahead_clear === undefined || second === undefined)) return; // asked again
      const from_behind = behind > 0 ? (second ?? Infinity) - behind : Infinity;
      // Things behind the camera are not in its way.
      const clear = Math.min(ahead_clear ?? Infinity, from_behind >= 0 ? from_behind : Infinity);
      const passes = behind > 0 || !is_near || (second ?? Infinity) >= length(come);
      this.checked_ = passes ? from : checked;
      if (!passes) this.end_ = checked;
      if (!passes) return;
      known.unshift({ origin: from, direction, clear, asked: length(ahead), width });
      known.splice(most_known);
      const along = this.moved_unchecked_ && dot(sub(this.moved_unchecked_, from), direction);
      this.moved_unchecked_ = undefined;
      if (along !== undefined && along > clear - clearance)
        this.end_ = add(from, scale(direction, Math.max(0, clear - clearance)));
    };
    const rays: Ray[] = [{ origin: from, direction }];
    if (behind > 0) rays.push({ origin: sub(from, scale(direction, behind)), direction });
    else if (checked && is_near)
      rays.push({ origin: checked, direction: normalize(come, forward) });
    const unknown = (): undefined => undefined;
    const answers = rays.map((ray) => ask(ray).catch(unknown));
    void Promise.all(answers).then(([clear, second]) => answered(clear, second));
  }
}

/** How far along the way a point is; undefined: beside it. */
function along_of({ origin, direction }: KnownWay, point: Vec3, width: number): number | undefined {
  const offset = sub(point, origin);
  const along = dot(offset, direction);
  const beside = length(sub(offset, scale(direction, along)));
  return along >= -width && beside <= width ? along : undefined;
}
