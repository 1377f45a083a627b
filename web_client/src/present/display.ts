// Shows the newest picture on the canvas as this page's newest camera sees it, at the rate of the
// display.
import { half_height, type CameraSample, type Eye } from '../camera/eye';
import type { Picture } from '../decode/picture';
import type { FrameHeader } from '../wire/wire';
import type { Depths, Pixels, Placing, Presenter } from './presenter';
import { TurnForecast } from './turn_forecast';
import { can_show, reach, uncovered_share, warp_matrix, type Matrix3, type Sides } from './warp';
import { WarpPolicy, type WarpMode, type WarpState } from './warp_policy';

interface DisplayEnvironment {
  now_us: () => number;
  on_refresh: (draw: () => void) => void;
  /** The display wants pictures of another size. */
  overscan_changed: () => void;
}

/** The camera that the canvas shows. */
export interface ShownView extends Eye {
  /** Share of the canvas that the picture does not cover. */
  readonly uncovered: number;
}

interface Size {
  readonly width_px: number;
  readonly height_px: number;
}

interface Shown extends Size {
  readonly eye: Eye;
  readonly depths: Depths | undefined;
}

const no_motion_rad = 1e-6;
const farthest_reach = 2.5;

export class Display {
  private readonly policy_: WarpPolicy;
  private readonly turn_ = new TurnForecast();
  private camera_: CameraSample | undefined;
  private picture_: Shown | undefined;
  private view_: Eye | undefined;
  private redraw_due_ = false;
  private depth_part_: typeof import('./depth_mesh') | undefined;

  constructor(
    private readonly presenter_: Presenter,
    private readonly env_: DisplayEnvironment,
    public size: Size,
  ) {
    this.policy_ = new WarpPolicy(presenter_.can_warp);
  }

  set mode(mode: WarpMode) {
    this.policy_.mode = mode;
    this.env_.overscan_changed();
    this.redraw_soon();
  }

  /** Whether pictures may be larger than the view. */
  set may_overscan(may: boolean) {
    this.policy_.may_overscan = may;
    this.env_.overscan_changed();
  }

  /** Warps by the depths of pictures from now on. */
  set depth_part(part: typeof import('./depth_mesh')) {
    this.depth_part_ = part;
    this.env_.overscan_changed();
  }

  get wants_depths(): boolean {
    return this.warps && this.depth_part_ !== undefined;
  }

  get warps(): boolean {
    return this.policy_.active;
  }

  get warp_state(): WarpState {
    return this.policy_.state;
  }

  /**
   * Sides of the picture over those of the view. Pictures have even sides. With the factor of the policy
   * itself, a camera at rest would see between their pixels.
   */
  get overscan(): Sides {
    const { x, y } = this.policy_.overscan;
    const even = (factor: number, px: number): number =>
      factor === 1 ? 1 : (2 * Math.round((factor * px) / 2)) / px;
    return { x: even(x, this.size.width_px), y: even(y, this.size.height_px) };
  }

  private get aspect(): number {
    return this.size.width_px / this.size.height_px;
  }

  /** This page's newest camera. */
  set camera(sample: CameraSample) {
    this.camera_ = sample;
    this.turn_.moved(sample);
    this.redraw_soon();
  }

  async draw(picture: Picture, eye: Eye, header: FrameHeader): Promise<void> {
    const { widthPx: width_px, heightPx: height_px } = header;
    const depths = this.depth_part_?.unpack_depths(header);
    this.picture_ = { eye, width_px, height_px, depths };
    const placing = this.placing();
    const begin_us = this.env_.now_us();
    await this.presenter_.draw(picture, placing);
    this.view_ = placing ? this.eye() : eye;
    if (placing) this.note(placing, this.env_.now_us() - begin_us);
  }

  read(): (Pixels & { readonly view: ShownView }) | undefined {
    const { picture_: picture, view_: view } = this;
    if (!picture || !view) return undefined;
    const uncovered = uncovered_share(this.matrix(picture, view));
    return { ...this.presenter_.read(), view: { ...view, uncovered } };
  }

  private redraw_soon(): void {
    if (this.redraw_due_ || !this.policy_.active || !this.picture_) return;
    this.redraw_due_ = true;
    this.env_.on_refresh(() => {
      this.redraw_due_ = false;
      const placing = this.placing();
      if (!placing || this.view_ === this.eye()) return;
      const begin_us = this.env_.now_us();
      this.presenter_.redraw(placing);
      this.view_ = this.eye();
      this.note(placing, this.env_.now_us() - begin_us);
    });
  }

  private eye(): Eye | undefined {
    return this.camera_?.eye;
  }

  private placing(): Placing | undefined {
    const { picture_: picture, camera_: camera } = this;
    if (!picture || !camera || !this.policy_.active) return undefined;
    if (!can_show(picture.eye, camera.eye)) return undefined;
    const matrix = this.matrix(picture, camera.eye);
    // After a jump the view sees almost nothing of the picture, which is then better left as it is.
    const { x, y } = reach(matrix);
    if (Math.max(x, y) > farthest_reach) return undefined;
    const height_px = Math.round(picture.height_px / this.overscan.y);
    const surface =
      picture.depths &&
      this.depth_part_?.depth_surface(
        picture.depths,
        picture.eye,
        camera.eye,
        picture.width_px / picture.height_px,
        this.aspect,
      );
    return { matrix, surface, width_px: Math.round(height_px * this.aspect), height_px };
  }

  private matrix({ eye, width_px, height_px, depths }: Shown, view: Eye): Matrix3 {
    const distance = (depths ?? this.camera_)?.distance ?? Infinity;
    return warp_matrix(eye, view, width_px / height_px, distance, this.aspect);
  }

  /** Tells the policy how the view of a moving camera was drawn. */
  private note({ matrix }: Placing, draw_us: number): void {
    const { picture_: picture, view_: view } = this;
    if (!picture || !view) return;
    const now_us = this.env_.now_us();
    this.turn_.drawn(picture.eye.orientation, now_us);
    const tall = half_height(picture.eye) / half_height(view);
    const wide = (tall * picture.width_px) / picture.height_px / this.aspect;
    const shown = reach(matrix);
    let needed = { x: shown.x * wide, y: shown.y * tall };
    if (Math.max(Math.abs(needed.x - 1), Math.abs(needed.y - 1)) < no_motion_rad) return;
    // Also ask for what this turn will need next. The overscan it needed so far comes too late.
    const later = this.turn_.eye_later(now_us);
    if (later) {
      const coming = reach(warp_matrix(view, later, this.aspect, Infinity));
      needed = { x: Math.max(needed.x, coming.x), y: Math.max(needed.y, coming.y) };
    }
    if (this.policy_.drawn(needed, draw_us, now_us)) this.env_.overscan_changed();
  }
}
