import type { Picture } from '../decode/picture';
import { i420_to_rgba, type PlaneLayout } from './i420';
import { size_of, type Pixels, type Presenter } from './presenter';

/** For machines without a GPU. A 640x360 frame takes 11 ms of CPU, where software WebGL takes 19. */
export class Canvas2dPresenter implements Presenter {
  readonly kind = 'canvas_2d';
  readonly can_warp = false;
  readonly most_px = Infinity;
  private yuv_ = new Uint8Array(0);
  private image_: ImageData | undefined;

  constructor(
    private readonly canvas_: OffscreenCanvas,
    private readonly context_: OffscreenCanvasRenderingContext2D,
  ) {}

  async draw(picture: Picture): Promise<void> {
    const [width, height] = size_of(picture);
    if (this.canvas_.width !== width || this.canvas_.height !== height) {
      this.canvas_.width = width;
      this.canvas_.height = height;
    }
    if (is_limited_709(picture)) await this.draw_yuv(picture, width, height);
    else this.context_.drawImage(picture, 0, 0, width, height);
  }

  redraw(): void {
    throw new Error('a 2D canvas cannot warp');
  }

  read(): Pixels {
    const { width, height } = this.canvas_;
    const { data } = this.context_.getImageData(0, 0, width, height);
    return { width_px: width, height_px: height, rgba: data };
  }

  private async draw_yuv(frame: VideoFrame, width: number, height: number): Promise<void> {
    const bytes = frame.allocationSize();
    if (this.yuv_.length < bytes) this.yuv_ = new Uint8Array(bytes);
    if (this.image_?.width !== width || this.image_.height !== height) {
      this.image_ = new ImageData(width, height);
    }
    const layout = await frame.copyTo(this.yuv_);
    const rgba = new Uint32Array(this.image_.data.buffer);
    i420_to_rgba(this.yuv_, layout as [PlaneLayout, PlaneLayout, PlaneLayout], width, height, rgba);
    this.context_.putImageData(this.image_, 0, 0);
  }
}

/** The format that our encoders send and software decoders give. The browser converts all others. */
function is_limited_709(picture: Picture): picture is VideoFrame {
  if (!('colorSpace' in picture) || picture.format !== 'I420') return false;
  const { matrix, fullRange } = picture.colorSpace;
  const even = picture.displayWidth % 2 === 0 && picture.displayHeight % 2 === 0;
  const unscaled =
    picture.visibleRect?.width === picture.displayWidth &&
    picture.visibleRect.height === picture.displayHeight;
  return matrix === 'bt709' && fullRange !== true && even && unscaled;
}
