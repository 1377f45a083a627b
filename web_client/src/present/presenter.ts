import type { Picture } from '../decode/picture';
import type { Matrix3 } from './warp';

export interface Pixels {
  readonly width_px: number;
  readonly height_px: number;
  /** RGBA, 8 bit, rows from the top. */
  readonly rgba: Uint8ClampedArray<ArrayBuffer>;
}

/** How a picture is put into the view; without one it fills the view as it is. */
export interface Placing {
  /** From places in the view to places in the picture. */
  readonly matrix: Matrix3;
  /** Of the canvas. */
  readonly width_px: number;
  readonly height_px: number;
}

/**
 * Draws pictures on the canvas at their native size; CSS scales the canvas to the view, which is
 * free on a GPU and the cheapest there is without one.
 */
export interface Presenter {
  /** For people: how pictures get on the canvas. */
  readonly description: string;
  /** Heeds the placing, and redraws. */
  readonly can_warp: boolean;
  /** The picture is free again when the promise resolves; one draw at a time. */
  draw(picture: Picture, placing?: Placing): Promise<void>;
  /** The last picture once more, placed anew. Only where it can warp. */
  redraw(placing: Placing): void;
  /** What was drawn last. */
  read(): Pixels;
}

/** Size to show a picture at; a VideoFrame's coded size may have padding. */
export function size_of(picture: Picture): readonly [width: number, height: number] {
  return 'displayWidth' in picture
    ? [picture.displayWidth, picture.displayHeight]
    : [picture.width, picture.height];
}
