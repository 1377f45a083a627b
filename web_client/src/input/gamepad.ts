// Game controllers: the left stick moves, the right one looks.
import { no_axes, sum_of, type Axes } from '../camera/movement';

export type GamepadAction = 'next' | 'previous' | 'play' | 'reset' | 'mode';

type Pad = Pick<Gamepad, 'axes' | 'buttons' | 'connected' | 'mapping' | 'index'>;

const dead_zone = 0.15;
const poll_ms = 50; // soon enough for the first press; after it the camera loop reads every frame
const largest_rest = 0.35; // of a worn stick
const jitter = 0.03;
const rests_after_ms = 2000; // no hand holds a stick so still
const unheld_after_ms = 10_000; // not even at its end

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
// Without the browsers' "standard" layout these mean the same on most controllers, and the others may be anything:
// triggers that rest at -1, pedals, throttles.
const common_axes = 2;
const common_buttons = 4;

/** Beyond the dead zone the response is quadratic. */
function deflection(value: number): number {
  const size = Math.abs(value);
  if (size <= dead_zone) return 0;
  return Math.sign(value) * Math.min(1, (size - dead_zone) / (1 - dead_zone)) ** 2;
}

/** One axis. A stick at rest is not at 0: where it rests is learned when it comes, and while nobody touches it. */
class RestingAxis {
  private rest_ = 0;
  private still_: { readonly value: number; readonly since_ms: number };

  /** `may_be_other`: than the axis of a stick. Where it lies still, nobody holds it. */
  constructor(
    value: number,
    now_ms: number,
    private readonly may_be_other_: boolean,
  ) {
    if (Math.abs(value) <= largest_rest || may_be_other_) this.rest_ = value;
    this.still_ = { value, since_ms: now_ms };
  }

  read(value: number, now_ms: number): number {
    const still_ms = now_ms - this.still_.since_ms;
    if (Math.abs(value - this.still_.value) > jitter) this.still_ = { value, since_ms: now_ms };
    else if (still_ms >= rests_after_ms && Math.abs(value) <= largest_rest) this.rest_ = value;
    else if (still_ms >= unheld_after_ms && this.may_be_other_) return 0;
    return deflection(value - this.rest_);
  }
}

/** One controller. */
export class Controller {
  private readonly axes_: RestingAxis[] = [];
  private held_ = new Set<number>();

  axes(pad: Pad, now_ms: number): Axes {
    const is_standard = pad.mapping === 'standard';
    const [right = 0, back = 0, turn_right = 0, turn_down = 0] = pad.axes
      .slice(0, is_standard ? 4 : common_axes)
      .map((value, i) =>
        (this.axes_[i] ??= new RestingAxis(value, now_ms, !is_standard)).read(value, now_ms),
      );
    const move = { right, forward: 0 - back };
    if (!is_standard) return { ...no_axes, ...move };
    const pressed = (button: number): number => pad.buttons[button]?.value ?? 0;
    return {
      ...move,
      turn_right,
      turn_up: 0 - turn_down,
      up: deflection(pressed(right_trigger)) - deflection(pressed(left_trigger)),
      fast: Math.max(pressed(left_shoulder), pressed(right_shoulder)) > 0.5,
    };
  }

  /** What buttons were pressed for since the last call. */
  pressed(pad: Pad): GamepadAction[] {
    const before = this.held_;
    const known = pad.mapping === 'standard' ? Infinity : common_buttons;
    const held = actions.filter(([i]) => i < known && pad.buttons[i]?.pressed === true);
    this.held_ = new Set(held.map(([button]) => button));
    return held.flatMap(([button, action]) => (before.has(button) ? [] : [action]));
  }
}

/** Reads all controllers: the one that is used counts. Nothing runs while there is none. */
export class Gamepads {
  private timer_: ReturnType<typeof setInterval> | undefined;
  private readonly known_ = new Map<number, Controller>();

  constructor(private readonly listener_: { moved(): void; action(action: GamepadAction): void }) {
    const look = (): void => {
      clearInterval(this.timer_);
      const connected = this.pads().map(({ index }) => index);
      for (const index of this.known_.keys())
        if (!connected.includes(index)) this.known_.delete(index);
      this.timer_ = connected.length > 0 ? setInterval(() => this.poll(), poll_ms) : undefined;
    };
    window.addEventListener('gamepadconnected', look);
    window.addEventListener('gamepaddisconnected', look);
  }

  axes(): Axes {
    if (this.timer_ === undefined || document.hidden) return no_axes; // nobody tells it of what is let go
    const now_ms = performance.now();
    return sum_of(...this.pads().map((pad) => this.controller(pad).axes(pad, now_ms)));
  }

  private pads(): Pad[] {
    return navigator.getGamepads().filter((pad): pad is Gamepad => pad?.connected === true);
  }

  private controller({ index }: Pad): Controller {
    const known = this.known_.get(index) ?? new Controller();
    this.known_.set(index, known);
    return known;
  }

  private poll(): void {
    if (document.hidden) return;
    for (const pad of this.pads())
      for (const action of this.controller(pad).pressed(pad)) this.listener_.action(action);
    this.listener_.moved();
  }
}
