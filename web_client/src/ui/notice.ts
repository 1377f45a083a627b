import { by_id, on_click } from './dom';

const passing_ms = 20_000;

/** A line at the top of the page. Visitors can dismiss it; a passing one disappears by itself. */
export class Notice {
  private timer_: ReturnType<typeof setTimeout> | undefined;
  private readonly notice_ = by_id('notice', HTMLElement);
  private readonly text_ = by_id('notice-text', HTMLElement);

  constructor() {
    on_click('notice-close', () => this.hide());
  }

  show(message: string, passing = false): void {
    clearTimeout(this.timer_);
    if (passing) this.timer_ = setTimeout(() => this.hide(), passing_ms);
    this.text_.textContent = message;
    this.notice_.hidden = false;
  }

  private hide(): void {
    this.notice_.hidden = true;
  }
}
