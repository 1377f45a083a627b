import { by_id, on_click } from './dom';

/** A line at the top of the page. Visitors can dismiss it; a passing one disappears by itself. */
export class Notice {
  private timer_: ReturnType<typeof setTimeout> | undefined;
  private readonly notice_ = by_id('notice', HTMLElement);
  private readonly text_ = by_id('notice-text', HTMLElement);

  constructor() {
    on_click('notice-close', () => this.hide());
  }

  /** `for_s`: how long; undefined: until the visitor dismisses it. */
  show(message: string, for_s?: number): void {
    clearTimeout(this.timer_);
    if (for_s !== undefined) this.timer_ = setTimeout(() => this.hide(), for_s * 1000);
    this.text_.textContent = message;
    this.notice_.hidden = false;
  }

  /** It is not true any more. */
  withdraw(message: string): void {
    if (this.text_.textContent === message) this.hide();
  }

  private hide(): void {
    this.notice_.hidden = true;
  }
}
