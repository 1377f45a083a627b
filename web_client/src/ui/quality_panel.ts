import type { KeptTexts } from '../base/browser_storage';
import { by_id, on_click } from '../page/dom';
import type { Navigation } from '../page/navigation';
import type { WarpMode } from '../present/warp_policy';
import type { PictureSize } from '../session/quality';
import { factor, number } from '../text/number';
import { text } from '../text/text';
import type { WorkerClient } from '../worker/client';
import type { StreamSize } from './stream_size';

const degrees = 180 / Math.PI;
const speed_key = 'catgs-speed';

/** The panel for size and rate of pictures, smooth turning, field of view, speed, and which way is up. */
export class QualityPanel {
  private readonly fov_ = by_id('view-fov', HTMLInputElement);
  private readonly fov_value_ = by_id('view-fov-value', HTMLElement);
  private readonly speed_ = by_id('view-speed', HTMLInputElement);
  private readonly speed_value_ = by_id('view-speed-value', HTMLElement);
  private readonly up_done_ = by_id('up-done', HTMLElement);

  constructor(
    private readonly navigation_: Navigation,
    stream_size: StreamSize,
    worker: WorkerClient,
    private readonly storage_: KeptTexts,
  ) {
    const size = by_id('quality-size', HTMLSelectElement);
    const fps = by_id('quality-fps', HTMLSelectElement);
    const chosen = (): void => stream_size.choose(picture_size(size.value), Number(fps.value));
    size.addEventListener('change', chosen);
    fps.addEventListener('change', chosen);
    const warp = by_id('view-warp', HTMLSelectElement);
    warp.addEventListener('change', () =>
      worker.post({ kind: 'warp', mode: warp.value as WarpMode }),
    );
    this.fov_.addEventListener('input', () =>
      navigation_.set_fov(this.fov_.valueAsNumber / degrees),
    );
    this.speed_.addEventListener('input', () =>
      navigation_.set_speed(2 ** this.speed_.valueAsNumber),
    );
    const kept = Number(storage_.getItem(speed_key));
    if (kept > 0) navigation_.set_speed(kept);
    for (const [id, turns] of [
      ['up-left', 0.25],
      ['up-right', -0.25],
    ] as const) {
      on_click(id, () => navigation_.turn_up(turns * 2 * Math.PI));
    }
    on_click('up-flip', () => navigation_.turn_over());
    on_click('up-surface', () => void this.stand_here());
    navigation_.changed.listen(() => this.show());
    this.show();
  }

  private async stand_here(): Promise<void> {
    this.up_done_.textContent = '';
    if (!(await this.navigation_.stand_here())) this.up_done_.textContent = text.quality.no_surface;
  }

  private show(): void {
    const fov_y_deg = Math.round(this.navigation_.camera.fov_y_rad * degrees);
    this.fov_.value = String(fov_y_deg);
    this.fov_value_.textContent = number(fov_y_deg, {
      style: 'unit',
      unit: 'degree',
      unitDisplay: 'narrow',
    });
    const { speed } = this.navigation_.camera;
    this.speed_.value = String(Math.log2(speed));
    this.speed_value_.textContent = factor(speed);
    this.storage_.setItem(speed_key, String(speed));
  }
}

const picture_size = (value: string): PictureSize =>
  value === 'auto' || value === 'sharp' || value === 'smooth' ? value : Number(value);
