import type { Picture } from '../decode/picture';
import type { Matrix3 } from './warp';

export interface Pixels {
  readonly width_px: number;
  readonly height_px: number;
  /** RGBA, 8 bit, rows from the top. */
  readonly rgba: Uint8ClampedArray<ArrayBuffer>;
}

/** The depth grid of a picture. */
export interface Depths {
  readonly columns: number;
  readonly rows: number;
  /** By rows from the top, 1 / world units. */
  readonly inverse_depths: Float32Array;
  /** Of the plane that stands for all of the picture where one is enough. */
  readonly distance: number;
  /** The largest inverse depth. */
  readonly nearest: number;
}

/** A picture in the view that is not plane. */
export interface Surface {
  /** Draws the texture that is bound. */
  draw(gl: WebGL2RenderingContext): void;
}

/** Places a picture in the view. A picture without a placing fills the view as it is. */
export interface Placing {
  /** From points of the view to points of the picture. */
  readonly matrix: Matrix3;
  /** Undefined: the matrix places it. */
  readonly surface?: Surface | undefined;
  /** Size of the canvas. */
  readonly width_px: number;
  readonly height_px: number;
}

export type PresenterKind = 'webgl2' | 'canvas_2d';

/**
 * Draws pictures on the canvas at their native size. CSS scales the canvas to the view, which is free
 * on a GPU and the cheapest way without one.
 */
export interface Presenter {
  /** How pictures get on the canvas. */
  readonly kind: PresenterKind;
  /** Whether it uses placings and can redraw. */
  readonly can_warp: boolean;
  /** The longest side of a picture that it can draw. */
  readonly most_px: number;
  /** The promise resolves when the picture may be closed. Only one draw runs at a time. */
  draw(picture: Picture, placing?: Placing): Promise<void>;
  /** Draws the last picture again with another placing. Only for presenters that can warp. */
  redraw(placing: Placing): void;
  /** Reads back what was drawn last. */
  read(): Pixels;
}

/** Size to show a picture at; a VideoFrame's coded size may have padding. */
export function size_of(picture: Picture): readonly [width: number, height: number] {
  return 'displayWidth' in picture
    ? [picture.displayWidth, picture.displayHeight]
    : [picture.width, picture.height];
}
