// Leads a walking visitor to where they point on the floor, and shows where that is.
import type { Timers, Clock } from '../base/clock';
import {
  add,
  dot,
  forward,
  length,
  look_at,
  normalize,
  rotate,
  same,
  scale,
  sub,
  type Vec3,
} from '../base/vector';
import type { Eye } from '../camera/eye';
import { glide, path_of, type Flight, type PathSample } from '../camera/flight';
import { project } from '../camera/ray';
import type { Pointed } from '../input/pointers';
import type { Navigation } from '../page/navigation';
import { floor_along } from '../walk/floor';
import { MapWalker } from '../walk/map_walker';
import { find_path } from '../walk/path';
import { stroll } from '../walk/stroll';
import {
  cells_per_eye_height,
  eyes_of,
  to_world,
  type Stand,
  type WalkMap,
} from '../walk/walk_map';
import './floor_plan.css';

const svg = 'http://www.w3.org/2000/svg';
const ring_corners = 40;
const ring_cells = 0.28 * cells_per_eye_height;
const announced_s = 4; // the wire takes 256 samples
const announce_again_s = 2;
const flight_s = 2.5;

const warn = (error: unknown): void => console.warn('no path can be searched', error);

interface WalkingParts {
  readonly view: HTMLElement;
  readonly navigation: Navigation;
  readonly clock: Clock;
  readonly timers: Timers;
  /** Tells the server the path, for its forecasts. */
  readonly announce: (path: PathSample[]) => void;
  readonly reduced_motion: boolean;
}

export class Walking {
  readonly walker: MapWalker;
  private readonly ring_ = document.createElementNS(svg, 'polygon');
  private readonly picture_ = document.createElementNS(svg, 'svg');
  private shown_: Stand | undefined; // in the ring
  private target_: Stand | undefined; // of the path that is searched
  private walks_ = false;
  private eye_: Eye;
  private cancel_announcing_ = (): void => undefined;
  private readonly stop_ = new AbortController();

  constructor(
    private readonly parts_: WalkingParts,
    readonly map: WalkMap,
  ) {
    const { view, navigation } = parts_;
    this.walker = new MapWalker(map);
    this.eye_ = navigation.eye;
    this.picture_.id = 'floor-ring';
    this.picture_.setAttribute('class', 'on-floor');
    this.picture_.setAttribute('aria-hidden', 'true');
    this.picture_.append(this.ring_);
    view.append(this.picture_);
    navigation.gestures.set('walk', (pointed) => this.take(pointed));
    const { signal } = this.stop_;
    view.addEventListener('pointermove', (event) => this.pointed(event), { signal });
    view.addEventListener('pointerleave', () => this.show(undefined), { signal });
  }

  /** The visitor has left the scene. */
  end(): void {
    this.stop_.abort();
    this.stay();
    this.cancel_announcing_();
    this.parts_.navigation.gestures.remove('walk');
    this.picture_.remove();
  }

  /**
   * A visitor who has chosen to walk comes to the floor below, unless something is in between. False: there is none
   * within a step beside.
   */
  async come_down(): Promise<boolean> {
    const { camera } = this.parts_.navigation;
    const { position } = camera.pose;
    const waits = (): boolean =>
      camera.mode === 'walk' &&
      !camera.is_orthographic &&
      !camera.is_flying &&
      same(camera.pose.position, position);
    if (!waits()) return true;
    const eyes = this.walker.eyes_below(position);
    if (!eyes) return false;
    const { up } = camera;
    const fall = dot(sub(position, eyes), up);
    if (Math.abs(fall) > this.walker.step) {
      const clear = await this.parts_.navigation.distance_along({
        origin: position,
        direction: scale(up, -1),
      });
      const floor = fall + this.walker.eye_height;
      if (!(Math.abs(clear - floor) <= 2 * this.walker.step)) return false;
      if (!waits()) return true;
    }
    this.parts_.navigation.stand(eyes);
    return true;
  }

  /** Walks there, or flies where the visitor does not stand. */
  async go_to(to: Stand): Promise<void> {
    const { navigation, reduced_motion } = this.parts_;
    navigation.leave_orthographic();
    const eye = navigation.eye;
    if (navigation.camera.mode !== 'walk' || !this.walker.stand_near(eye.position)) {
      const position = eyes_of(this.map, to);
      const duration_s = reduced_motion
        ? 0
        : Math.min(flight_s, length(sub(position, eye.position)) / this.walker.eye_height);
      this.travel(glide(eye, { ...eye, position }, duration_s));
      return;
    }
    navigation.stop_flight();
    this.target_ = to;
    const path = await find_path(
      this.map,
      this.walker.stand_at(eye.position),
      to,
      () => this.target_ === to,
    );
    const moved =
      length(sub(navigation.eye.position, eye.position)) > this.map.radius * this.map.cell;
    if (this.target_ !== to || moved || path.length === 0) return; // no flight through walls either
    const way = stroll(this.map, path, navigation.eye);
    this.travel(reduced_motion ? { duration_s: 0, at: () => way.at(way.duration_s) } : way);
    if (reduced_motion) return;
    this.walks_ = true;
    this.show(to);
  }

  /** The visitor wants something else now. */
  stay(): void {
    this.target_ = undefined;
  }

  /** Flies down there, and looks level along the heading of `before`. */
  land(to: Stand, before: Eye): void {
    const { navigation, reduced_motion } = this.parts_;
    const [, north, up] = this.map.axes;
    const view = rotate(before.orientation, forward);
    const heading = normalize(sub(view, scale(up, dot(view, up))), north);
    const position = eyes_of(this.map, to);
    const eye = {
      position,
      orientation: look_at(position, add(position, heading), up),
      fov_y_rad: before.fov_y_rad,
    };
    this.travel(glide(navigation.eye, eye, reduced_motion ? 0 : flight_s));
  }

  /** Walks to where a walking visitor clicks on the floor. */
  private take({ x, y, how }: Pointed): boolean {
    const { navigation } = this.parts_;
    const to =
      navigation.camera.mode === 'walk' && !navigation.camera.is_orthographic
        ? floor_along(this.map, navigation.ray_at(x, y))
        : undefined;
    if (!to) return false;
    if (how === 'double tap') return true; // the first of two clicks leads there
    navigation.taken_over.emit();
    this.go_to(to).catch(warn);
    return true;
  }

  private travel(way: Flight): void {
    const { navigation, clock, timers, announce } = this.parts_;
    this.cancel_announcing_();
    const begin_us = clock.now_us();
    navigation.fly(way, (arrived) => {
      this.cancel_announcing_();
      this.walks_ = false;
      this.show(undefined);
      if (!arrived) announce([]);
    });
    const tell = (): void => {
      const time_s = (clock.now_us() - begin_us) / 1e6;
      const rest_s = Math.min(announced_s, way.duration_s - time_s);
      if (!(rest_s > 0)) return;
      announce(path_of(way, time_s, rest_s, clock.now_us()));
      this.cancel_announcing_ = timers.after(announce_again_s * 1000, tell);
    };
    tell();
  }

  /** The camera of the picture is here now. */
  move(eye: Eye): void {
    this.eye_ = eye;
    this.draw();
  }

  /** A mouse that rests or moves shows where a click would lead. */
  private pointed({ pointerType, buttons, offsetX, offsetY }: PointerEvent): void {
    const { view, navigation } = this.parts_;
    if (this.walks_ || pointerType !== 'mouse') return;
    const shows =
      buttons === 0 && navigation.camera.mode === 'walk' && !navigation.gestures.has('measure');
    const ray = navigation.ray_at(offsetX / view.clientWidth, offsetY / view.clientHeight);
    this.show(shows ? floor_along(this.map, ray) : undefined);
  }

  private show(stand: Stand | undefined): void {
    this.shown_ = stand;
    this.draw();
  }

  /** Also when the mode has changed. */
  draw(): void {
    const corners = this.shown_ ? this.corners(this.shown_) : [];
    const inside = corners.every((corner) => corner !== undefined);
    this.picture_.classList.toggle(
      'shown',
      corners.length > 0 && inside && this.parts_.navigation.camera.mode === 'walk',
    );
    if (inside)
      this.ring_.setAttribute(
        'points',
        corners.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join(' '),
      );
  }

  private corners(stand: Stand): (readonly [number, number] | undefined)[] {
    const { clientWidth: width, clientHeight: height } = this.parts_.view;
    return Array.from({ length: ring_corners }, (_, k) => {
      const angle = (2 * Math.PI * k) / ring_corners;
      const east = stand.east + ring_cells * Math.cos(angle);
      const north = stand.north + ring_cells * Math.sin(angle);
      const corner: Vec3 = to_world(this.map, { east, north, height: stand.height });
      const at = project(corner, this.eye_, width / Math.max(1, height));
      return at && ([at[0] * width, at[1] * height] as const);
    });
  }
}
