import { by_id, on_click } from './dom';

/** What a visitor can do about a notice by one press. */
export interface Offer {
  readonly label: string;
  take(): void;
}

/** A line at the top of the page. Visitors can dismiss it; a passing one disappears by itself. */
export class Notice {
  private timer_: ReturnType<typeof setTimeout> | undefined;
  private readonly notice_ = by_id('notice', HTMLElement);
  private readonly text_ = by_id('notice-text', HTMLElement);
  private readonly button_ = by_id('notice-offer', HTMLButtonElement);
  private offer_: Offer | undefined;

  constructor() {
    on_click('notice-close', () => this.hide());
    on_click('notice-offer', () => {
      this.hide();
      this.offer_?.take();
    });
  }

  /** `for_s`: how long; undefined: until the visitor dismisses it. */
  show(message: string, for_s?: number, offer?: Offer): void {
    clearTimeout(this.timer_);
    if (for_s !== undefined) this.timer_ = setTimeout(() => this.hide(), for_s * 1000);
    this.text_.textContent = message;
    this.offer_ = offer;
    this.button_.hidden = !offer;
    this.button_.textContent = offer?.label ?? '';
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
