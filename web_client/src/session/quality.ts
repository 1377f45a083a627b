import { AutoHeight } from './auto_height';

export interface View {
  readonly width_px: number; // device pixels
  readonly height_px: number;
}

export interface Quality {
  readonly height_px: number; // while the camera moves; 0: the view's
  readonly still_height_px: number; // when it rests; 0: the view's
  readonly max_fps: number; // 0: the server's default
}

/** Lines of the picture, 0 for those of the view, or how to find them. */
export type PictureSize = number | 'auto' | 'sharp' | 'smooth';

// A picture takes as long as the rate allows that the choice is about.
const target_frame_ms = { auto: 1000 / 24, sharp: 1000 / 10, smooth: 1000 / 48 } as const;

/** What is asked of the server: as the visitor chose, or as it keeps up. */
export class QualityChoice {
  private size_: PictureSize = 'auto';
  private max_fps_ = 0;
  private automatic_ = new AutoHeight(target_frame_ms.auto);

  choose(size: PictureSize, max_fps: number): void {
    if (typeof size !== 'number' && size !== this.size_) {
      this.automatic_ = new AutoHeight(target_frame_ms[size]);
    }
    this.size_ = size;
    this.max_fps_ = max_fps;
  }

  get is_automatic(): boolean {
    return typeof this.size_ !== 'number';
  }

  /** Once a second, with the server's mean time per frame. Returns whether the height changed. */
  look(frame_ms: number, view_height_px: number): boolean {
    return this.is_automatic && this.automatic_.look(frame_ms, view_height_px);
  }

  in_view(view_height_px: number): Quality {
    const height_px =
      typeof this.size_ === 'number' ? this.size_ : this.automatic_.height_px(view_height_px);
    // However small pictures have to be to keep up with a moving camera: one that stays can wait.
    const still_height_px = typeof this.size_ === 'number' ? this.size_ : 0;
    return { height_px, still_height_px, max_fps: this.max_fps_ };
  }
}
