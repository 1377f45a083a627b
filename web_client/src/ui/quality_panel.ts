import type { WarpMode } from '../present/warp_policy';
import type { PictureSize } from '../session/quality';
import type { WorkerClient } from '../worker/client';
import { by_id, on_click } from './dom';
import type { Navigation } from './navigation';
import type { StreamSize } from './stream_size';

const degrees = 180 / Math.PI;

/** The panel for size and rate of pictures, smooth turning and field of view. */
export class QualityPanel {
  private readonly fov_ = by_id('view-fov', HTMLInputElement);
  private readonly fov_value_ = by_id('view-fov-value', HTMLElement);

  constructor(
    private readonly navigation_: Navigation,
    stream_size: StreamSize,
    worker: WorkerClient,
  ) {
    const size = by_id('quality-size', HTMLSelectElement);
    const fps = by_id('quality-fps', HTMLSelectElement);
    const chosen = (): void => stream_size.choose(picture_size(size.value), Number(fps.value));
    size.addEventListener('change', chosen);
    fps.addEventListener('change', chosen);
    const warp = by_id('view-warp', HTMLSelectElement);
    warp.addEventListener('change', () => worker.post({ kind: 'warp', mode: warp.value as WarpMode }));
    this.fov_.addEventListener('input', () => navigation_.set_fov(this.fov_.valueAsNumber / degrees));
    on_click('view-flip', () => navigation_.flip_up());
    navigation_.changed.listen(() => this.show());
    this.show();
  }

  private show(): void {
    const fov_y_deg = Math.round(this.navigation_.camera.fov_y_rad * degrees);
    this.fov_.value = String(fov_y_deg);
    this.fov_value_.textContent = `${fov_y_deg}°`;
  }
}

const picture_size = (value: string): PictureSize =>
  value === 'auto' || value === 'sharp' || value === 'smooth' ? value : Number(value);
