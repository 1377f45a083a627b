import { by_id } from './dom';

/** A line at the top that stays until it is dismissed. */
export class Notice {
  private readonly notice_ = by_id('notice', HTMLElement);
  private readonly text_ = by_id('notice-text', HTMLElement);

  constructor() {
    by_id('notice-close', HTMLButtonElement).addEventListener('click', () => {
      this.notice_.hidden = true;
    });
  }

  show(message: string): void {
    this.text_.textContent = message;
    this.notice_.hidden = false;
  }
}
