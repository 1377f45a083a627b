// A visit in a headset: WebXR shows the scene to both eyes, and the head is the camera of the page.
import { add, clamp, forward, look_at, rotate, type Vec3 } from '../base/vector';
import type { Pose } from '../camera/eye';
import { by_id } from '../page/dom';
import type { PageParts } from '../page/parts';
import { AutoHeight } from '../session/auto_height';
import { frame_ms_of } from '../session/quality';
import type { MeasureList } from '../tour/measure_list';
import type { TourPlayer } from '../tour/player';
import type { WalkMap } from '../walk/walk_map';
import type { HeadsetPicture, HeadsetStream } from '../worker/headset';
import { head_of, rate_for, same_stream, stream_for, type Head } from './eyes';
import { SpaceHotspots } from './hotspots';
import { Locomotion } from './locomotion';
import { Overlay } from './overlay';
import { HeadsetOverscan } from './overscan';
import { Panel } from './panel';
import { PictureView } from './picture_view';
import { Pointers, type Target } from './pointers';
import type { RoomRay } from './plate';
import { Teleport } from './teleport';

export interface HeadsetParts
  extends Pick<
    PageParts,
    'worker' | 'navigation' | 'notice' | 'storage' | 'clock' | 'seen' | 'toolbar'
  > {
  readonly tours: { readonly player: TourPlayer };
  readonly measures: MeasureList;
  readonly walkable_area: { readonly map: WalkMap | undefined; want_map(): void };
}

const darkens_key = 'catgs.headset.darken';
const assumed_floor_m = 1.6; // below the eyes, where the headset does not know it
const target_frame_ms = 1000 / 60;
const look_ms = 1000;
const longest_hold_ms = 1000; // of a picture for which no refresh comes
const longest_dark_ms = 10_000; // after a jump, and longer than scenes take to open
const bright_in_ms = 250;
const shade_in_ms = 150;
const longest_step_s = 0.1;
const latest_ms = 100; // a display time farther ahead is none

interface Worn {
  readonly session: XRSession;
  readonly space: XRReferenceSpace;
  readonly layer: XRWebGLLayer;
  /** Of the camera that the head has put there; another one: somebody else has moved it. */
  put: Pose | undefined;
  last_ms: number;
  /** A picture of this pose or a later one shows where the visitor has jumped to. */
  awaited: { readonly pose_id: number; readonly until_ms: number } | undefined;
  dark: number;
  border: number;
  stream: HeadsetStream | undefined; // as the server was asked for it
  rate_hz: number; // measured
  counted: number;
  counted_from_ms: number;
}

/** What is drawn with, until the context is lost. */
interface Drawing {
  readonly gl: WebGL2RenderingContext;
  readonly picture: PictureView;
  readonly overlay: Overlay;
  readonly panel: Panel;
  readonly hotspots: SpaceHotspots;
}

export class Headset {
  private drawing_: Drawing | undefined;
  private worn_: Worn | undefined;
  private readonly moves_: Locomotion;
  private readonly teleport_ = new Teleport();
  private readonly pointers_: Pointers;
  private readonly overscan_ = new HeadsetOverscan();
  private readonly height_ = new AutoHeight(target_frame_ms);
  private waiting_: HeadsetPicture | undefined;
  private server_fps_ = 60;
  private head_: Head<XRView> | undefined;
  private view_height_px_ = 0;
  private darkens_: boolean;

  constructor(private readonly parts_: HeadsetParts) {
    const { worker, navigation, storage } = parts_;
    this.darkens_ = storage.getItem(darkens_key) !== 'no';
    this.moves_ = new Locomotion(navigation);
    this.pointers_ = new Pointers({
      target: (ray) => this.target(ray),
      aim_begins: () => this.teleport_.begin(),
      aim_ends: (goes) => {
        const floor = this.teleport_.end();
        if (goes) this.go_to(floor);
      },
      turn: (steps) => this.turn(steps),
    });
    worker.on('picture', (message) => this.take(message));
    worker.on('config', ({ config }) => {
      this.server_fps_ = config.fps;
      this.choose_rate();
    });
    navigation.sampled.listen((sample) => {
      if (this.worn_) this.overscan_.moved(sample);
    });
    document.addEventListener('visibilitychange', () => this.tell_hidden());
    setInterval(() => void this.look_at_speed(), look_ms);
  }

  async enter(session: XRSession): Promise<void> {
    const drawing = (this.drawing_ ??= this.make_drawing());
    const { gl } = drawing;
    await gl.makeXRCompatible();
    // No larger than the headset's own pixels.
    const most = XRWebGLLayer.getNativeFramebufferScaleFactor(session);
    const layer = new XRWebGLLayer(session, gl, {
      alpha: false,
      framebufferScaleFactor: most > 0 ? Math.min(1, most) : 1,
    });
    void session.updateRenderState({ baseLayer: layer, depthNear: 0.05, depthFar: 1e5 });
    const space = await session.requestReferenceSpace('local-floor').catch(async () => {
      const at_head = await session.requestReferenceSpace('local');
      return at_head.getOffsetReferenceSpace(new XRRigidTransform({ y: -assumed_floor_m }));
    });
    const { navigation, walkable_area } = this.parts_;
    navigation.taken_over.emit(); // nobody else leads a head
    navigation.leave_orthographic();
    navigation.jumps = true;
    walkable_area.want_map();
    this.worn_ = {
      session,
      space,
      layer,
      put: undefined,
      last_ms: performance.now(),
      awaited: undefined,
      dark: 0,
      border: 0,
      stream: undefined,
      rate_hz: 0,
      counted: 0,
      counted_from_ms: performance.now(),
    };
    session.addEventListener('end', () => this.ended());
    session.addEventListener('visibilitychange', () => {
      if (session.visibilityState !== 'visible') this.pointers_.let_go();
      this.tell_hidden();
    });
    // Somebody has centred the headset anew: the visitor stays where they are in the scene.
    space.addEventListener('reset', () => {
      if (this.worn_) this.worn_.put = undefined;
    });
    this.pointers_.bind(session, space);
    this.choose_rate();
    session.requestAnimationFrame(this.refresh);
  }

  private make_drawing(): Drawing {
    const canvas = document.createElement('canvas');
    const gl = canvas.getContext('webgl2', { xrCompatible: true, alpha: false });
    if (!gl) throw new Error('there is no WebGL2');
    canvas.addEventListener('webglcontextlost', () => {
      this.drawing_ = undefined;
      this.leave();
    });
    const panel = new Panel(gl, {
      leave: () => this.leave(),
      darkens: () => this.darkens_,
      set_darkens: (on) => {
        this.darkens_ = on;
        this.parts_.storage.setItem(darkens_key, on ? 'yes' : 'no');
      },
    });
    return {
      gl,
      picture: new PictureView(gl),
      overlay: new Overlay(gl),
      panel,
      hotspots: new SpaceHotspots(gl, (index) => this.press_stop(index)),
    };
  }

  private leave(): void {
    this.worn_?.session.end().catch(() => undefined); // it has ended by itself
  }

  /** Leads to a stop; who is there goes through its portal. */
  private press_stop(index: number): void {
    const { player } = this.parts_.tours;
    const { stop, stop_index } = player.state;
    if (stop?.portal && stop_index === index) by_id('tour-portal', HTMLButtonElement).click();
    else player.go_to(index);
  }

  /** The flat page continues where the head was. */
  private ended(): void {
    const { worn_: worn, head_: head } = this;
    if (!worn) return;
    this.worn_ = this.head_ = undefined;
    this.pointers_.let_go();
    this.release(0);
    this.drawing_?.picture.clear();
    const { navigation, worker } = this.parts_;
    navigation.jumps = false;
    worker.post({ kind: 'headset', stream: undefined });
    this.tell_hidden();
    if (!head) return;
    const { camera } = navigation;
    const { position, orientation } = this.moves_.rig.to_world(head.pose);
    const ahead = add(position, rotate(orientation, forward));
    const upright = look_at(position, ahead, camera.up);
    navigation.put_back({ position, orientation: upright, fov_y_rad: camera.fov_y_rad });
  }

  /** A headset that is worn shows pictures, whatever becomes of the page's window. */
  private tell_hidden(): void {
    const { worn_: worn } = this;
    const hidden = worn ? worn.session.visibilityState === 'hidden' : document.hidden;
    if (hidden) this.release(0);
    this.parts_.worker.post({ kind: 'hidden', hidden });
  }

  private take(message: HeadsetPicture): void {
    this.waiting_?.picture.close();
    this.waiting_ = message;
    if (this.worn_?.session.visibilityState === 'hidden' || !this.worn_) return this.release(0);
    // A headset that somebody has taken off may stop to refresh without a word.
    setTimeout(() => {
      if (this.waiting_ === message) this.release(0);
    }, longest_hold_ms);
  }

  /** The worker may send the next picture. `seen_us`: 0 where nobody sees this one. */
  private release(seen_us: number): void {
    if (!this.waiting_) return;
    this.waiting_.picture.close();
    this.waiting_ = undefined;
    this.parts_.worker.post({ kind: 'shown', seen_us, rate_hz: this.worn_?.rate_hz ?? 0 });
  }

  private readonly refresh = (now_ms: number, frame: XRFrame): void => {
    const { worn_: worn, drawing_: drawing } = this;
    if (!worn || !drawing || frame.session !== worn.session) return;
    worn.session.requestAnimationFrame(this.refresh);
    const viewer = frame.getViewerPose(worn.space);
    if (!viewer) return; // the headset has lost its way for a moment
    const now = performance.now();
    const refresh_ms = 1000 / this.rate_hz(worn.session);
    const { predictedDisplayTime: said = now_ms + refresh_ms } = frame as {
      predictedDisplayTime?: number;
    };
    const seen_ms = clamp(said, now, now + latest_ms);
    const head = head_of(viewer);
    const dt_s = Math.min((now - worn.last_ms) / 1000, longest_step_s);
    worn.last_ms = now;
    this.head_ = head;
    this.count(worn, now);
    this.move(worn, drawing, head.pose, frame, dt_s);
    this.send(worn, head, seen_ms * 1000);
    this.show_newest(worn, drawing, seen_ms * 1000);
    this.fade(worn, dt_s * 1000, now);
    this.draw(worn, drawing, head, now);
  };

  /** Follows what has moved the camera of the page, then what the visitor does. */
  private move(worn: Worn, drawing: Drawing, head: Pose, frame: XRFrame, dt_s: number): void {
    const { navigation, tours, measures, walkable_area } = this.parts_;
    const { camera } = navigation;
    // A film of the camera moves by itself, which nobody stands in a headset.
    if (tours.player.state.playing && !tours.player.state.stop) tours.player.pause();
    if (camera.is_flying) camera.step(Infinity); // to its end
    if (this.moves_.look(walkable_area.map, measures.metres_per_unit, head)) this.darken(worn);
    if (camera.pose !== worn.put) {
      this.moves_.place(camera.pose, head);
      this.darken(worn);
      worn.put = camera.pose;
    }
    const { rig } = this.moves_;
    drawing.hotspots.look(tours.player.state, rig, head.position);
    this.pointers_.look(frame, worn.space);
    const ray = this.pointers_.aim_ray(frame, worn.space);
    if (ray)
      this.teleport_.point(
        ray,
        {
          rig,
          head,
          map: walkable_area.map,
          up: camera.up,
          distance_along: (along) => navigation.distance_along(along),
        },
        performance.now(),
      );
    const moves = this.moves_.push(this.pointers_.push, head, dt_s);
    if (moves) navigation.taken_over.emit();
    const wanted = moves && this.darkens_ ? 1 : 0;
    const step = (dt_s * 1000) / shade_in_ms;
    worn.border = clamp(wanted, worn.border - step, worn.border + step);
  }

  /** The camera of the page is the head, and the server hears of it. */
  private send(worn: Worn, head: Head<XRView>, seen_us: number): void {
    const { navigation, worker } = this.parts_;
    const { rig } = this.moves_;
    navigation.camera.jump(rig.to_world(head.pose));
    worn.put = navigation.camera.pose;
    const [eye] = head.eyes;
    if (!eye) return;
    this.view_height_px_ = worn.layer.getViewport(eye.view)?.height ?? this.view_height_px_;
    const stream = stream_for(head, {
      overscan: this.overscan_.sides,
      height_px: this.height_.height_px(this.view_height_px_),
      most_px: this.most_px,
      rate_hz: this.rate_hz(worn.session),
      units_per_metre: rig.units_per_metre,
    });
    if (stream && !same_stream(worn.stream, stream, rig.units_per_metre)) {
      worn.stream = stream;
      worker.post({ kind: 'headset', stream });
    }
    navigation.loop.sample(Math.round(seen_us));
  }

  private get most_px(): number {
    const gl = this.drawing_?.gl;
    return Math.min(8192, Number(gl?.getParameter(gl.MAX_TEXTURE_SIZE)) || 8192);
  }

  private show_newest(worn: Worn, { picture }: Drawing, seen_us: number): void {
    const { waiting_: newest } = this;
    if (!newest) return;
    picture.show(newest);
    if (worn.awaited && Number(newest.header.poseId) >= worn.awaited.pose_id)
      worn.awaited = undefined;
    this.release(Math.round(seen_us));
  }

  private fade(worn: Worn, dt_ms: number, now_ms: number): void {
    if (worn.awaited && now_ms > worn.awaited.until_ms) worn.awaited = undefined;
    if (!worn.awaited) worn.dark = Math.max(0, worn.dark - dt_ms / bright_in_ms);
  }

  /** Until there is a picture of where the visitor is now. */
  private darken(worn: Worn): void {
    worn.dark = 1;
    this.await_picture(worn);
  }

  /** The newest pictures are of where the visitor was, or looked, before. */
  private await_picture(worn: Worn): void {
    this.overscan_.jumped();
    const pose_id = this.parts_.navigation.loop.pose_id + 1;
    worn.awaited = { pose_id, until_ms: performance.now() + longest_dark_ms };
  }

  private draw(worn: Worn, drawing: Drawing, head: Head<XRView>, now_ms: number): void {
    const { gl, picture, overlay, panel, hotspots } = drawing;
    const { rig } = this.moves_;
    const { position } = head.pose;
    overlay.clear();
    hotspots.draw(overlay);
    overlay.shade(worn.border, worn.dark);
    // These stay while the scene is dark.
    this.teleport_.draw(overlay, rig, position);
    // It would hide where who aims will stand.
    if (!this.teleport_.is_on) panel.draw(overlay, head.pose, now_ms);
    this.pointers_.draw(overlay, position);
    overlay.upload();
    gl.bindFramebuffer(gl.FRAMEBUFFER, worn.layer.framebuffer);
    gl.clearColor(0.03, 0.03, 0.04, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const { view, half, pose, frustum } of head.eyes) {
      const port = worn.layer.getViewport(view);
      if (!port || port.width === 0) continue;
      gl.viewport(port.x, port.y, port.width, port.height);
      picture.draw(half, rig.to_world(pose), frustum);
      overlay.draw(view.projectionMatrix, view.transform.inverse.matrix);
    }
    const [eye] = head.eyes;
    const shown = eye && picture.camera_of(eye.half);
    if (!shown || worn.awaited) return;
    const seen = { ...rig.to_world(eye.pose), orientation: rig.to_world(head.pose).orientation };
    const now_us = this.parts_.clock.now_us();
    this.overscan_.drawn(shown, seen, eye.parallel, shown.distance, now_us);
  }

  private target(ray: RoomRay): Target | undefined {
    const { drawing_: drawing } = this;
    const panel = this.teleport_.is_on ? undefined : drawing?.panel; // it is hidden then
    return panel?.pointed(ray) ?? drawing?.hotspots.pointed(ray);
  }

  private go_to(floor: Vec3 | undefined): void {
    const { worn_: worn, head_: head } = this;
    if (!floor || !worn || !head) return;
    this.parts_.navigation.taken_over.emit();
    this.moves_.rig.stand_at(floor, head.pose);
    this.darken(worn);
  }

  private turn(steps: number): void {
    const { worn_: worn, head_: head } = this;
    if (!worn || !head) return;
    this.parts_.navigation.taken_over.emit();
    this.moves_.turn(steps, head.pose);
    this.await_picture(worn);
  }

  private count(worn: Worn, now_ms: number): void {
    worn.counted += 1;
    const over_ms = now_ms - worn.counted_from_ms;
    if (over_ms < look_ms) return;
    worn.rate_hz = (worn.counted * 1000) / over_ms;
    worn.counted = 0;
    worn.counted_from_ms = now_ms;
  }

  private rate_hz(session: XRSession): number {
    return rate_for(session.supportedFrameRates, this.server_fps_) ?? session.frameRate ?? 72;
  }

  private choose_rate(): void {
    const session = this.worn_?.session;
    const rate = session && rate_for(session.supportedFrameRates, this.server_fps_);
    if (!session || !rate || rate === session.frameRate) return;
    session.updateTargetFrameRate(rate).catch(() => undefined); // the headset keeps its own
  }

  /** Pictures are as large as the server draws in time. */
  private async look_at_speed(): Promise<void> {
    if (!this.worn_ || this.view_height_px_ === 0) return;
    const { stages_ms } = await this.parts_.worker.stats();
    this.height_.look(frame_ms_of(stages_ms), this.view_height_px_);
  }
}
