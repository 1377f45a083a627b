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

/** Lines of the picture, 0 for the view's, or a way to choose them. */
export type PictureSize = number | 'auto' | 'sharp' | 'smooth';

// Time per frame of the rate that each choice aims at.
const target_frame_ms = { auto: 1000 / 24, sharp: 1000 / 10, smooth: 1000 / 48 } as const;

const refresh_ms = 1000 / 60;

/** Time per frame of the slower one: the server, or this device. Pictures wait for a refresh, too. */
export const frame_ms_of = (stages_ms: {
  readonly render: number;
  readonly encode: number;
  readonly present: number;
}): number => Math.max(stages_ms.render + stages_ms.encode, stages_ms.present - refresh_ms);

/** Chooses the size and rate of pictures: by the visitor, or by the speed of the server. */
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

  /** Takes the server's mean time per frame once a second. Returns whether the height changed. */
  look(frame_ms: number, view_height_px: number): boolean {
    return this.is_automatic && this.automatic_.look(frame_ms, view_height_px);
  }

  in_view(view_height_px: number): Quality {
    const height_px =
      typeof this.size_ === 'number' ? this.size_ : this.automatic_.height_px(view_height_px);
    // Moving pictures may have to be small to keep up. A picture that stays can take its time.
    const still_height_px = typeof this.size_ === 'number' ? this.size_ : 0;
    return { height_px, still_height_px, max_fps: this.max_fps_ };
  }
}
