import type { Picture } from '../decode/picture';

export interface Pixels {
  readonly width_px: number;
  readonly height_px: number;
  /** RGBA, 8 bit, rows from the top. */
  readonly rgba: Uint8ClampedArray<ArrayBuffer>;
}

/**
 * Draws pictures on the canvas at their native size; CSS scales the canvas to the view, which is
 * free on a GPU and the cheapest there is without one.
 */
export interface Presenter {
  /** For people: how pictures get on the canvas. */
  readonly description: string;
  /** The picture is free again when the promise resolves; one draw at a time. */
  draw(picture: Picture): Promise<void>;
  /** What draw() drew last. */
  read(): Pixels;
}

/** Size to show a picture at; a VideoFrame's coded size may have padding. */
export function size_of(picture: Picture): readonly [width: number, height: number] {
  return 'displayWidth' in picture
    ? [picture.displayWidth, picture.displayHeight]
    : [picture.width, picture.height];
}
