// Game controllers with the "standard" layout of browsers: the left stick moves, the right one looks.
import { no_axes, type Axes } from '../camera/movement';

export type GamepadAction = 'next' | 'previous' | 'play' | 'reset' | 'mode';

type Pad = Pick<Gamepad, 'axes' | 'buttons' | 'connected'>;

const dead_zone = 0.15;
const poll_ms = 50; // soon enough for the first press; after it the camera loop reads every frame

const left_shoulder = 4;
const right_shoulder = 5;
const left_trigger = 6;
const right_trigger = 7;
const actions: readonly (readonly [button: number, action: GamepadAction])[] = [
  [0, 'next'],
  [1, 'previous'],
  [2, 'mode'],
  [3, 'reset'],
  [9, 'play'],
];

/** A stick at rest is never quite at 0, so there is a dead zone. Beyond it the response is quadratic. */
function deflection(value: number | undefined): number {
  const size = Math.abs(value ?? 0);
  if (size <= dead_zone) return 0;
  return Math.sign(value ?? 0) * Math.min(1, (size - dead_zone) / (1 - dead_zone)) ** 2;
}

export function gamepad_axes(pad: Pad): Axes {
  const pressed = (button: number): number => pad.buttons[button]?.value ?? 0;
  return {
    right: deflection(pad.axes[0]),
    forward: -deflection(pad.axes[1]),
    turn_right: deflection(pad.axes[2]),
    turn_up: -deflection(pad.axes[3]),
    up: deflection(pressed(right_trigger)) - deflection(pressed(left_trigger)),
    fast: pressed(left_shoulder) > 0 || pressed(right_shoulder) > 0,
  };
}

/** Reads the first connected controller. Nothing runs while there is none. */
export class Gamepads {
  private timer_: ReturnType<typeof setInterval> | undefined;
  private held_ = new Set<number>();

  constructor(private readonly listener_: { moved(): void; action(action: GamepadAction): void }) {
    const look = (): void => {
      clearInterval(this.timer_);
      this.timer_ = this.pad() ? setInterval(() => this.poll(), poll_ms) : undefined;
    };
    window.addEventListener('gamepadconnected', look);
    window.addEventListener('gamepaddisconnected', look);
  }

  axes(): Axes {
    const pad = this.timer_ === undefined ? undefined : this.pad();
    return pad ? gamepad_axes(pad) : no_axes;
  }

  private pad(): Pad | undefined {
    for (const pad of navigator.getGamepads()) if (pad?.connected) return pad;
    return undefined;
  }

  private poll(): void {
    const pad = this.pad();
    if (!pad) return;
    for (const [button, action] of actions) {
      const pressed = pad.buttons[button]?.pressed === true;
      if (pressed && !this.held_.has(button)) this.listener_.action(action);
      if (pressed) this.held_.add(button);
      else this.held_.delete(button);
    }
    this.listener_.moved();
  }
}
