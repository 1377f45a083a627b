import { browser_timers } from '../base/clock';
import {
  frame_ms_of,
  QualityChoice,
  type PictureSize,
  type Quality,
  type View,
} from '../session/quality';
import type { WorkerClient } from '../worker/client';

const resize_quiet_ms = 200;
const look_interval_ms = 1000;

/** Asks the server for picture sizes that suit the view, the visitor's choice and the server's speed. */
export class StreamSize {
  private readonly choice_ = new QualityChoice();
  private is_live_ = false;
  private ratio_ = window.devicePixelRatio; // as the server knows it

  constructor(
    private readonly element_: HTMLElement,
    private readonly worker_: WorkerClient,
  ) {
    worker_.on('state', ({ state }) => {
      this.is_live_ = state.phase === 'live';
    });
    let cancel = (): void => undefined;
    new ResizeObserver(() => {
      cancel();
      cancel = browser_timers.after(resize_quiet_ms, () => this.post());
    }).observe(element_);
    setInterval(() => {
      // The window moves to another screen: its size in CSS pixels stays.
      if (window.devicePixelRatio !== this.ratio_) this.post();
      void this.look();
    }, look_interval_ms);
  }

  choose(size: PictureSize, max_fps: number): void {
    this.choice_.choose(size, max_fps);
    this.post();
  }

  get view(): View {
    const { clientWidth, clientHeight } = this.element_;
    const ratio = window.devicePixelRatio;
    return {
      width_px: Math.max(16, Math.round(clientWidth * ratio)),
      height_px: Math.max(16, Math.round(clientHeight * ratio)),
    };
  }

  get quality(): Quality {
    return this.choice_.in_view(this.view.height_px);
  }

  private async look(): Promise<void> {
    if (!this.choice_.is_automatic || !this.is_live_) return;
    const { stages_ms } = await this.worker_.stats();
    if (this.choice_.look(frame_ms_of(stages_ms), this.view.height_px)) this.post();
  }

  private post(): void {
    this.ratio_ = window.devicePixelRatio;
    this.worker_.post({ kind: 'view', view: this.view, quality: this.quality });
  }
}
