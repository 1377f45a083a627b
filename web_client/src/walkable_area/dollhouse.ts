// Shows a storey from outside, without its ceiling, and leads back in.
import { Signal } from '../base/signal';
import { add, forward, rotate, scale } from '../base/vector';
import type { Eye } from '../camera/eye';
import type { CameraMode } from '../camera/mode';
import type { Pointed } from '../input/pointers';
import type { Clipping } from '../page/clipping';
import type { Navigation } from '../page/navigation';
import { ceiling_cut, dollhouse_eye } from '../walk/dollhouse';
import { floor_along } from '../walk/floor';
import type { Block, Stand, WalkMap } from '../walk/walk_map';

interface DollhouseParts {
  readonly view: HTMLElement;
  readonly clipping: Clipping;
  readonly navigation: Navigation;
  readonly reduced_motion: boolean;
  /** The visitor has pointed at a point on the floor. */
  readonly go_to: (stand: Stand) => void;
}

const outside_mode: CameraMode = 'orbit';

/** Where the visitor was. */
interface Before {
  readonly eye: Eye;
  readonly mode: CameraMode;
}

export class Dollhouse {
  readonly changed = new Signal<boolean>();
  private before_: Before | undefined;

  constructor(
    private readonly parts_: DollhouseParts,
    private readonly map_: WalkMap,
    private readonly around_: Block,
  ) {}

  get shown(): boolean {
    return this.before_ !== undefined;
  }

  show(storey: number): void {
    const { navigation, view, clipping, reduced_motion } = this.parts_;
    const { camera } = navigation;
    clipping.ceiling = ceiling_cut(this.map_, storey);
    if (!this.before_) {
      this.before_ = { eye: camera.perspective_eye, mode: camera.mode };
      navigation.taken_over.emit();
      navigation.set_mode(outside_mode);
      navigation.gestures.set('dollhouse', this.take);
      camera.unlimited = true;
      this.changed.emit(true);
    }
    const { eye, focus } = dollhouse_eye(
      this.map_,
      this.around_,
      storey,
      navigation.eye.fov_y_rad,
      view.clientWidth / Math.max(1, view.clientHeight),
    );
    camera.fly_to(eye, focus, reduced_motion);
    navigation.loop.wake();
  }

  /** Back to where the visitor was. */
  leave(): void {
    const before = this.end();
    if (!before) return;
    const { navigation, reduced_motion } = this.parts_;
    const ahead = add(
      before.eye.position,
      scale(rotate(before.eye.orientation, forward), navigation.reach),
    );
    navigation.camera.fly_to(before.eye, ahead, reduced_motion);
    navigation.loop.wake();
  }

  /**
   * The whole scene again, in the mode from before, if nobody has chosen another. The caller moves the camera from
   * where it is.
   */
  end(): Before | undefined {
    const { before_: before } = this;
    const { navigation } = this.parts_;
    if (before) {
      this.close();
      if (navigation.camera.mode === outside_mode) navigation.set_mode(before.mode);
    }
    return before;
  }

  /** The visitor is back at once: something else leads the camera on from there. */
  led_away(): void {
    const before = this.end();
    if (before) this.parts_.navigation.camera.jump(before.eye);
  }

  /** The whole scene again. */
  close(): void {
    if (!this.before_) return;
    this.before_ = undefined;
    const { navigation, clipping } = this.parts_;
    clipping.ceiling = undefined;
    navigation.camera.unlimited = false;
    navigation.gestures.remove('dollhouse');
    this.changed.emit(false);
  }

  private readonly take = ({ x, y, how }: Pointed): boolean => {
    const stand =
      how === 'double tap'
        ? undefined
        : floor_along(this.map_, this.parts_.navigation.ray_at(x, y));
    if (stand) this.parts_.go_to(stand);
    return true;
  };
}
