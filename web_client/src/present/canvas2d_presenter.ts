import type { Picture } from '../decode/picture';
import { size_of, type Pixels, type Presenter } from './presenter';

/** Without a GPU this is several times cheaper than WebGL in software, and looks the same. */
export class Canvas2dPresenter implements Presenter {
  readonly description = '2D canvas (no hardware WebGL2)';

  constructor(
    private readonly canvas_: OffscreenCanvas,
    private readonly context_: OffscreenCanvasRenderingContext2D,
  ) {}

  draw(picture: Picture): void {
    const [width, height] = size_of(picture);
    if (this.canvas_.width !== width || this.canvas_.height !== height) {
      this.canvas_.width = width;
      this.canvas_.height = height;
    }
    this.context_.drawImage(picture, 0, 0, width, height);
  }

  read(): Pixels {
    const { width, height } = this.canvas_;
    const { data } = this.context_.getImageData(0, 0, width, height);
    return { width_px: width, height_px: height, rgba: data };
  }
}
