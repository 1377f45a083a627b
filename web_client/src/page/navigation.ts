// Moves the visitor through the scene: by pointers, keys, sticks, points to look at, and flights.
import { browser_timers, type Clock } from '../base/clock';
import { Signal } from '../base/signal';
import { add, same, scale, type Vec3 } from '../base/vector';
import { CameraController } from '../camera/camera_controller';
import { CameraLoop } from '../camera/camera_loop';
import type { CameraSample, Eye } from '../camera/eye';
import type { Flight } from '../camera/flight';
import { Inertia } from '../camera/inertia';
import { camera_modes, type CameraMode } from '../camera/mode';
import { is_held, sum_of, type Axes, type Gesture } from '../camera/movement';
import { pixel_at, ray_through, surface_of, type Ray } from '../camera/ray';
import type { Walker } from '../camera/walker';
import { Gamepads, type GamepadAction } from '../input/gamepad';
import { bind_view_input, type ScrollGate } from '../input/view_input';
import type { Mark } from '../measure/measurement';
import { scene_setup, start_mode } from '../session/camera_messages';
import { Picks } from '../session/picks';
import type { SceneFacts, Welcome } from '../wire/wire';
import type { WorkerClient } from '../worker/client';
import { GestureRouter } from './gestures';

const speed_per_step = 2 ** 0.25;
const pointing_px = 1; // standard deviation of a click
const between_rays_ms = 80; // two at once: the server answers 32 a second

export class Navigation {
  readonly camera = new CameraController();
  readonly loop: CameraLoop;
  /** The visitor has entered another scene. */
  readonly entered = new Signal<{ scene: SceneFacts; scene_ids: readonly string[] }>();
  /** The visitor has begun to move the camera by a gesture, a key or a stick, or leaves the scene. */
  readonly taken_over = new Signal();
  /** The mode or the field of view may have changed. */
  readonly changed = new Signal();
  /** The visitor has chosen another mode. */
  readonly mode_chosen = new Signal();
  /** The camera went back to where visits begin. */
  readonly went_back = new Signal();
  /** A flight or a jump begins that is no gesture: somebody or something else leads the camera from now on. */
  readonly led_away = new Signal();
  /** The visitor has said which way is up. */
  readonly up_changed = new Signal();
  /** The visitor has chosen another speed by wheel or key. */
  readonly speed_chosen = new Signal<number>();
  readonly sampled = new Signal<CameraSample>();
  readonly pad_pressed = new Signal<GamepadAction>();
  readonly gestures = new GestureRouter();
  /** The scene's own (unit), whatever the visitor has chosen. */
  own_up: Vec3 = [0, -1, 0];
  /** Another visitor's camera leads this one, or has led it here: no tour starts by itself. */
  led = false;
  /** Flights end at once. */
  jumps = false;
  private readonly chosen_ups_ = new Map<string, Vec3>();
  private readonly inertia_ = new Inertia();
  private readonly picks_: Picks;
  private scene_id_: string | undefined;
  private overscan_ = { x: 1, y: 1 };
  private pointed_ = 0;
  private default_mode_: 'no' | 'any' | 'look' = 'any'; // 'no': somebody has chosen the mode

  constructor(
    private readonly view_: HTMLElement,
    worker: WorkerClient,
    clock: Clock,
    private readonly reduced_motion_: boolean,
    private readonly gate_: ScrollGate,
  ) {
    this.picks_ = new Picks((id, ray) => worker.post({ kind: 'pick', id, ray }), browser_timers);
    if (reduced_motion_) {
      this.camera.smoothing_s = 0;
      this.inertia_.enabled = false;
    }
    this.camera.asks_distance = async (ray) => {
      const pause = new Promise<void>((go_on) => browser_timers.after(between_rays_ms, go_on));
      const [distance] = await Promise.all([this.picks_.distance(ray), pause]);
      this.loop.wake();
      return distance;
    };
    this.up_changed.listen(() => this.chosen_ups_.set(this.scene_id, this.camera.up));
    const { axes, is_touched } = this.bind_input();
    this.loop = new CameraLoop(this.camera, axes, is_touched, this.inertia_, clock, (sample) => {
      worker.post({ kind: 'camera', sample });
      this.sampled.emit(sample);
    });
    worker.on('welcome', ({ welcome }) => this.welcomed(welcome));
    worker.on('picked', ({ id, hit }) => this.picks_.answered(id, hit));
    worker.on('presenter', ({ overscan }) => {
      // Pictures need another field of view from now on. A new sample makes the server render one.
      if (overscan.y !== this.overscan_.y || overscan.x !== this.overscan_.x) this.loop.changed();
      this.overscan_ = overscan;
    });
  }

  /** Id of the scene; '' before the first one. */
  get scene_id(): string {
    return this.scene_id_ ?? '';
  }

  get eye(): Eye {
    return this.camera.eye;
  }

  /** The scene's scale to a visitor, world units. */
  get reach(): number {
    return this.camera.reach;
  }

  fly(way: Flight, ended: (arrived: boolean) => void): void {
    this.led_away.emit();
    this.camera.fly(this.jumps ? { duration_s: 0, at: () => way.at(way.duration_s) } : way, ended);
    this.loop.wake();
  }

  stop_flight(): void {
    this.camera.stop_flight();
  }

  /** Puts the camera there, or as near as the scene's limits allow. Returns whether it is there. */
  put(eye: Eye): boolean {
    const is_plan = eye.view_height !== undefined; // seen from outside
    const position = is_plan ? eye.position : this.camera.within(eye.position);
    this.put_back({ ...eye, position });
    return same(position, eye.position);
  }

  /** Puts the camera where it was before. The walkable area of a scene may lie outside its limits. */
  put_back(eye: Eye): void {
    this.led_away.emit();
    this.camera.jump(eye);
    this.moved();
  }

  /** Back to where the camera was before an orthographic view. */
  leave_orthographic(): void {
    if (!this.camera.is_orthographic) return;
    this.taken_over.emit();
    this.camera.leave_orthographic();
    this.moved();
  }

  reset(): void {
    this.taken_over.emit();
    this.camera.reset();
    this.went_back.emit();
    this.moved();
  }

  /** Turns the scene about the view axis. Angles > 0 turn it to the left. */
  turn_up(angle_rad: number): void {
    this.camera.turn_up(angle_rad);
    this.up_changed.emit();
    this.moved();
  }

  /** Half a turn of the scene: what was up is down. */
  turn_over(): void {
    this.camera.turn_over();
    this.up_changed.emit();
    this.moved();
  }

  /** The up that the visitor has chosen for this scene; undefined: the scene's own. */
  get chosen_up(): Vec3 | undefined {
    return this.chosen_ups_.get(this.scene_id);
  }

  /** Chooses an up (unit) without moving the camera. */
  choose_up(up: Vec3): void {
    this.camera.set_up(up);
    this.up_changed.emit();
  }

  /** Makes the surface in the middle of the view the floor. Returns whether there is one. */
  async stand_here(): Promise<boolean> {
    const d = 0.04; // shares of the view: far enough apart for a direction, near enough for one surface
    const found = await Promise.all(
      [
        [-d, 0],
        [d, 0],
        [0, -d],
        [0, d],
      ].map(([x, y]) => this.point_at(0.5 + x!, 0.5 + y!)),
    );
    const floor = surface_of(found, this.eye.position);
    if (!floor) return false;
    this.led_away.emit();
    this.camera.stand_on(floor.point, floor.normal, this.reduced_motion_);
    this.up_changed.emit();
    this.loop.wake();
    return true;
  }

  /** The visitor's own factor on the speed of keys, sticks and flight. */
  set_speed(factor: number): void {
    this.camera.speed = factor;
    this.changed.emit();
  }

  /** `steps`: notches of a wheel, > 0 for faster. */
  faster(steps: number): void {
    this.set_speed(this.camera.speed * speed_per_step ** steps);
    this.speed_chosen.emit(this.camera.speed);
  }

  /** The visitor chooses the field of view. It ends a flight, which would choose it again. */
  set_fov(fov_y_rad: number): void {
    this.taken_over.emit();
    this.camera.stop_flight();
    this.camera.fov_y_rad = fov_y_rad;
    this.moved();
  }

  /** The visit began inside by looking around, and goes on by walking where that is possible. */
  get looks_by_default(): boolean {
    return this.default_mode_ === 'look';
  }

  set_mode(mode: CameraMode): void {
    this.default_mode_ = 'no';
    if (this.camera.is_orthographic) this.loop.changed();
    this.camera.set_mode(mode, this.reduced_motion_);
    this.loop.wake();
    this.changed.emit();
  }

  /** Who walks from now on. The camera stays where it is. */
  set_walker(walker: Walker): void {
    const { looks_by_default: looks, camera } = this;
    if (looks && !camera.is_orthographic && walker.stand_near(this.eye.position)) {
      this.set_mode('walk');
      this.default_mode_ = 'any';
    }
    camera.walker = walker;
  }

  /** A walking visitor comes to stand where their eyes are here. */
  stand(eyes: Vec3): void {
    this.camera.stand(eyes, this.reduced_motion_);
    this.loop.wake();
  }

  /** How far away what the ray meets is, world units; Infinity: nothing, or no answer comes. */
  async distance_along(ray: Ray): Promise<number> {
    return (await this.picks_.distance(ray)) ?? Infinity;
  }

  next_mode(): void {
    const next = camera_modes.indexOf(this.camera.mode) + 1;
    this.set_mode(camera_modes[next % camera_modes.length]!);
    this.mode_chosen.emit();
  }

  /** The point in the middle of the view; undefined: nothing is there. */
  point_ahead(): Promise<Vec3 | undefined> {
    return this.point_at(0.5, 0.5);
  }

  /** The point of the scene there, as a mark; undefined: nothing is there. `x`, `y`: as in Pointed. */
  async hit_at(x: number, y: number): Promise<Mark | undefined> {
    const { eye } = this; // it may move until the answer comes
    const ray = this.ray_at(x, y);
    const hit = await this.picks_.hit(ray);
    if (!hit) return undefined;
    const point = add(ray.origin, scale(ray.direction, hit.distance));
    return {
      point,
      direction: ray.direction,
      along: hit.spread,
      across: pointing_px * pixel_at(point, eye, this.view_.clientHeight),
    };
  }

  private bind_input(): { axes: () => Axes; is_touched: () => boolean } {
    const { keys, pointers } = bind_view_input(this.view_, this.inertia_, this.gate_, {
      gesture: (gesture) => this.gesture(gesture),
      wheeled: (steps, is_pinch) => {
        const flies = this.camera.mode === 'fly' && !this.camera.is_orthographic;
        if (flies && !is_pinch) this.faster(steps);
        else this.gesture({ kind: 'dolly', steps });
      },
      keys_changed: () => this.take_over(),
      let_go: () => this.loop.wake(),
      wants_presses: () => this.gestures.has('point'),
      pointed: (pointed) => this.gestures.route(pointed),
    });
    this.gestures.set('look', ({ x, y, how }) => {
      const walks = this.camera.mode === 'walk' && !this.camera.is_orthographic;
      const looks = how === 'double tap' || (how === 'touch' && walks);
      if (looks) void this.look_at(x, y);
      return looks;
    });
    const pads = new Gamepads({
      moved: () => {
        if (is_held(pads.axes())) this.take_over();
      },
      action: (action) => {
        if (action === 'mode') this.next_mode();
        else if (action === 'reset') this.reset();
        this.pad_pressed.emit(action);
      },
    });
    return {
      axes: () => sum_of(keys.axes(), pads.axes()),
      is_touched: () => pointers.count > 0,
    };
  }

  private gesture(gesture: Gesture): void {
    this.taken_over.emit();
    this.camera.gesture(gesture);
    this.loop.wake();
  }

  private take_over(): void {
    this.taken_over.emit();
    this.loop.wake();
  }

  /** Something other than a gesture has moved the camera. */
  private moved(): void {
    this.changed.emit();
    this.loop.changed();
  }

  private welcomed({ scene, sceneIds, watching }: Welcome): void {
    if (watching) return; // another visitor moves the camera
    // After a reconnect the visitor stays where they were.
    if (!scene || scene.sceneId === this.scene_id_) return;
    this.scene_id_ = scene.sceneId;
    this.camera.walker = undefined;
    this.camera.load(scene_setup(scene));
    this.own_up = this.camera.up;
    const up = this.chosen_up;
    if (up) {
      this.camera.set_up(up);
      this.camera.reset();
    }
    this.begin_in_mode(start_mode(scene), scene.startEnclosed);
    this.loop.enable();
    this.entered.emit({ scene, scene_ids: sceneIds });
  }

  /** `said`: by the scene. Otherwise, who has chosen no mode, or circles, begins inside by turning on the spot. */
  private begin_in_mode(said: CameraMode | undefined, enclosed: boolean): void {
    const { default_mode_: is_default, camera } = this;
    const free = is_default !== 'no' || (enclosed && camera.mode === 'orbit');
    const usual = enclosed ? 'fly' : 'orbit';
    this.set_mode(said ?? (free ? usual : camera.mode));
    if (free) this.default_mode_ = enclosed && !said ? 'look' : 'any';
  }

  /** Turns the camera to what is there, unless the visitor pointed elsewhere meanwhile. */
  private async look_at(x: number, y: number): Promise<void> {
    const pointed = ++this.pointed_;
    const point = await this.point_at(x, y);
    if (!point || pointed !== this.pointed_) return;
    this.taken_over.emit();
    this.camera.focus_on(point, this.reduced_motion_);
    this.loop.wake();
  }

  /** Point of the scene. `x`, `y`: shares of the view's width and height, y down. */
  private point_at(x: number, y: number): Promise<Vec3 | undefined> {
    return this.picks_.at(this.ray_at(x, y));
  }

  /** `x`, `y`: as in Pointed. */
  ray_at(x: number, y: number): Ray {
    return ray_through(
      this.eye,
      x,
      y,
      this.view_.clientWidth / Math.max(1, this.view_.clientHeight),
    );
  }
}
