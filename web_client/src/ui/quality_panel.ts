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
  private shown_fov_y_deg_ = NaN;
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
    on_click('view-fov-own', () => navigation_.set_fov(navigation_.camera.start_fov_y_rad));
    navigation_.sampled.listen(({ eye }) => this.show_fov(eye.fov_y_rad)); // flights change it, too
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
    this.show_fov(this.navigation_.camera.fov_y_rad);
    const { speed } = this.navigation_.camera;
    show_value(this.speed_, Math.log2(speed), this.speed_value_, factor(speed));
    this.storage_.setItem(speed_key, String(speed));
  }

  private show_fov(fov_y_rad: number): void {
    const fov_y_deg = Math.round(fov_y_rad * degrees);
    if (fov_y_deg === this.shown_fov_y_deg_) return;
    this.shown_fov_y_deg_ = fov_y_deg;
    const words = number(fov_y_deg, { style: 'unit', unit: 'degree', unitDisplay: 'narrow' });
    show_value(this.fov_, fov_y_deg, this.fov_value_, words);
  }
}

function show_value(
  slider: HTMLInputElement,
  value: number,
  output: HTMLElement,
  words: string,
): void {
  slider.value = String(value);
  slider.setAttribute('aria-valuetext', words);
  output.textContent = words;
}

const picture_size = (value: string): PictureSize =>
  value === 'auto' || value === 'sharp' || value === 'smooth' ? value : Number(value);
