// What the canvas shows: the newest picture, placed as the newest camera of this page sees it, at
// the rate of the display.
import type { Picture } from '../decode/picture';
import type { Pixels, Placing, Presenter } from './presenter';
import { reach, uncovered_share, warp_matrix, type CameraSample, type Eye } from './warp';
import { WarpPolicy, type WarpMode } from './warp_policy';

export interface DisplayEnvironment {
  now_us: () => number;
  on_refresh: (draw: () => void) => void;
  /** Pictures of another size are wanted. */
  overscan_changed: () => void;
}

/** The camera behind what is on the canvas. */
export interface ShownView extends Eye {
  /** Share of the canvas for which there was no picture. */
  readonly uncovered: number;
}

interface Shown {
  readonly eye: Eye;
  readonly width_px: number;
  readonly height_px: number;
}

const no_motion_rad = 1e-6;
const farthest_reach = 2.5;

export class Display {
  private readonly policy_: WarpPolicy;
  private camera_: CameraSample | undefined;
  private picture_: Shown | undefined;
  private view_: Eye | undefined;
  private redraw_due_ = false;

  constructor(
    private readonly presenter_: Presenter,
    private readonly env_: DisplayEnvironment,
  ) {
    this.policy_ = new WarpPolicy(presenter_.can_warp);
  }

  set mode(mode: WarpMode) {
    this.policy_.mode = mode;
    this.env_.overscan_changed();
    this.redraw_soon();
  }

  get warps(): boolean {
    return this.policy_.active;
  }

  get warp_state(): string {
    return this.policy_.state;
  }

  /** Sides of the picture by those of the view. */
  get overscan(): number {
    return this.policy_.overscan;
  }

  /** Where the camera of this page is. */
  set camera(sample: CameraSample) {
    this.camera_ = sample;
    this.redraw_soon();
  }

  async draw(picture: Picture, eye: Eye, width_px: number, height_px: number): Promise<void> {
    this.picture_ = { eye, width_px, height_px };
    const placing = this.placing();
    const begin_us = this.env_.now_us();
    await this.presenter_.draw(picture, placing);
    this.view_ = placing ? this.eye() : eye;
    if (placing) this.note(placing, this.env_.now_us() - begin_us);
  }

  read(): (Pixels & { readonly view: ShownView }) | undefined {
    const { picture_: picture, view_: view } = this;
    if (!picture || !view) return undefined;
    const uncovered = uncovered_share(warp_matrix(picture.eye, view, aspect(picture), this.camera_?.distance ?? Infinity));
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
    const { overscan } = this.policy_;
    const matrix = warp_matrix(picture.eye, camera.eye, aspect(picture), camera.distance);
    // A camera that jumped sees next to nothing of the picture: then it is better as it is.
    if (reach(matrix) > farthest_reach) return undefined;
    return {
      matrix,
      width_px: Math.round(picture.width_px / overscan),
      height_px: Math.round(picture.height_px / overscan),
    };
  }

  /** Tells the policy how a view was drawn whose camera moves. */
  private note({ matrix }: Placing, draw_us: number): void {
    const { picture_: picture, view_: view } = this;
    if (!picture || !view) return;
    const widening = Math.tan(picture.eye.fov_y_rad / 2) / Math.tan(view.fov_y_rad / 2);
    const needed = reach(matrix) * widening;
    if (Math.abs(needed - 1) < no_motion_rad) return;
    if (this.policy_.drawn(needed, draw_us, this.env_.now_us())) this.env_.overscan_changed();
  }
}

const aspect = ({ width_px, height_px }: Shown): number => width_px / height_px;
