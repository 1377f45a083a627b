// Controllers and hands: what they point at, press and push.
import { add, rotate, scale, type Vec3 } from '../base/vector';
import type { Overlay } from './overlay';
import type { RoomRay } from './plate';
import { pose_in_room } from './rig';
import { TurnStick, without_drift } from './stick';

/** Something that can be pressed. */
export interface Target {
  readonly id: string;
  readonly distance: number;
  press(): void;
}

interface Actions {
  /** What a ray meets first. */
  target(ray: RoomRay): Target | undefined;
  aim_begins(): void;
  /** `goes`: the visitor wants to be where they aim. */
  aim_ends(goes: boolean): void;
  /** Steps to the right. */
  turn(steps: number): void;
}

const least_hold_ms = 250; // a shorter press that meets nothing is a slip
const shown_m = 1.2; // of a ray that meets nothing

export class Pointers {
  private sticks_ = new WeakMap<XRInputSource, TurnStick>();
  private rays_: readonly { readonly ray: RoomRay; readonly target: Target | undefined }[] = [];
  private pressed_: { readonly source: XRInputSource; readonly id: string } | undefined;
  private aims_: XRInputSource | undefined;
  private aims_since_ms_ = 0;
  private push_: readonly [x: number, y: number] = [0, 0];

  constructor(private readonly actions_: Actions) {}

  /** Hears a session as long as it lasts. */
  bind(session: XRSession, space: XRReferenceSpace): void {
    this.let_go();
    session.addEventListener('selectstart', ({ inputSource: source, frame }) => {
      const ray = ray_of(source, frame, space);
      const target = ray && this.actions_.target(ray);
      if (target) this.pressed_ = { source, id: target.id };
      else this.aim(source);
    });
    session.addEventListener('selectend', ({ inputSource: source, frame }) => {
      if (this.aims_ === source)
        return this.end_aim(performance.now() - this.aims_since_ms_ >= least_hold_ms);
      if (this.pressed_?.source !== source) return;
      const ray = ray_of(source, frame, space);
      const target = ray && this.actions_.target(ray);
      if (target?.id === this.pressed_.id) target.press();
      this.pressed_ = undefined;
    });
  }

  /** Nothing is held any more: the session begins, or something else has the controllers. */
  let_go(): void {
    if (this.aims_) this.end_aim(false);
    this.pressed_ = undefined;
    this.rays_ = [];
    this.push_ = [0, 0];
    this.sticks_ = new WeakMap();
  }

  /** The ray of who aims. */
  aim_ray(frame: XRFrame, space: XRReferenceSpace): RoomRay | undefined {
    return this.aims_ && ray_of(this.aims_, frame, space);
  }

  /** How far the stick that moves the visitor is pushed: to the right, and back. */
  get push(): readonly [x: number, y: number] {
    return this.push_;
  }

  look(frame: XRFrame, space: XRReferenceSpace): void {
    const sources = [...frame.session.inputSources];
    if (this.aims_ && !sources.includes(this.aims_)) this.end_aim(false);
    this.rays_ = sources.flatMap((source) => {
      const ray = source === this.aims_ ? undefined : ray_of(source, frame, space);
      return ray ? [{ ray, target: this.actions_.target(ray) }] : [];
    });
    const with_sticks = sources.filter(({ gamepad }) => (gamepad?.axes.length ?? 0) >= 2);
    // One stick alone turns and teleports.
    const mover =
      with_sticks.length > 1
        ? with_sticks.find(({ handedness }) => handedness === 'left')
        : undefined;
    this.push_ = mover ? without_drift(...stick_of(mover)) : [0, 0];
    for (const source of with_sticks) if (source !== mover) this.steer(source);
  }

  draw(overlay: Overlay, eye: Vec3): void {
    for (const { ray, target } of this.rays_) {
      const end = add(ray.origin, scale(ray.direction, target?.distance ?? shown_m));
      const faint = target ? 0.8 : 0;
      overlay.line([ray.origin, end], 0.004, eye, [1, 1, 1, 0.6], [1, 1, 1, faint]);
    }
  }

  private steer(source: XRInputSource): void {
    const stick = this.sticks_.get(source) ?? new TurnStick();
    this.sticks_.set(source, stick);
    const { turn, aim } = stick.move(...stick_of(source));
    if (turn !== 0) this.actions_.turn(turn);
    if (aim === 'begins') this.aim(source);
    else if (aim === 'ends' && this.aims_ === source) this.end_aim(true);
  }

  private aim(source: XRInputSource): void {
    this.aims_ = source;
    this.aims_since_ms_ = performance.now();
    this.actions_.aim_begins();
  }

  private end_aim(goes: boolean): void {
    this.aims_ = undefined;
    this.actions_.aim_ends(goes);
  }
}

function ray_of(
  source: XRInputSource,
  frame: XRFrame,
  space: XRReferenceSpace,
): RoomRay | undefined {
  const found = frame.getPose(source.targetRaySpace, space);
  if (!found) return undefined;
  const { position, orientation } = pose_in_room(found.transform);
  return { origin: position, direction: rotate(orientation, [0, 0, 1]) };
}

/** Controllers have their stick at axes 2 and 3, behind a touchpad (WebXR Gamepads Module). */
function stick_of({ gamepad }: XRInputSource): readonly [x: number, y: number] {
  const axes = gamepad?.axes ?? [];
  return axes.length >= 4 ? [axes[2] ?? 0, axes[3] ?? 0] : [axes[0] ?? 0, axes[1] ?? 0];
}
