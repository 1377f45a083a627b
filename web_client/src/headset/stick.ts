// What the sticks of controllers ask for. Pure.

const pushed = 0.7;
const released = 0.4;
const dead = 0.15;

export interface StickEvents {
  /** Steps of a turn, > 0 to the right. */
  readonly turn: -1 | 0 | 1;
  /** A visitor aims at where they want to be while the stick is pushed ahead. */
  readonly aim: 'begins' | 'ends' | undefined;
}

/** Each push to a side is one turn. A push ahead begins to aim, and its release ends that. */
export class TurnStick {
  private turned_ = false;
  private aims_ = false;

  /** `x`: right, `y`: back, each -1…1. */
  move(x: number, y: number): StickEvents {
    const aside = Math.abs(x) > Math.abs(y);
    let turn: StickEvents['turn'] = 0;
    if (!this.turned_ && !this.aims_ && aside && Math.abs(x) > pushed) {
      this.turned_ = true;
      turn = x > 0 ? 1 : -1;
    } else if (Math.abs(x) < released) this.turned_ = false;
    let aim: StickEvents['aim'];
    if (!this.aims_ && !aside && y < -pushed) {
      this.aims_ = true;
      aim = 'begins';
    } else if (this.aims_ && y > -released) {
      this.aims_ = false;
      aim = 'ends';
    }
    return { turn, aim };
  }
}

/** A stick near its middle does not move anybody. */
export const without_drift = (x: number, y: number): readonly [x: number, y: number] =>
  Math.hypot(x, y) < dead ? [0, 0] : [x, y];
