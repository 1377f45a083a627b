import { Signal } from '../base/signal';

/**
 * Who gets the wheel and the finger. In a frame they scroll the article around it until somebody clicks or taps into
 * the frame, and again once they click elsewhere. `?scroll=always`: the frame gets them; `never`: the article.
 */
export class ScrollGate {
  /** The visitor scrolls the article over the picture. */
  readonly refused = new Signal();
  readonly opened = new Signal();
  private open_ = true;

  constructor(
    private readonly view_: HTMLElement,
    { search }: Pick<Location, 'search'>,
    is_framed: boolean,
  ) {
    const choice = new URLSearchParams(search).get('scroll');
    if (!is_framed || choice === 'always') return;
    this.set(false);
    if (choice === 'never') return;
    const open = (): void => {
      this.set(true);
      this.opened.emit();
    };
    window.addEventListener('click', open, { capture: true });
    window.addEventListener('blur', () => this.set(false));
  }

  /** Whether the frame takes this one. A pinch is meant for the picture. */
  takes(event: PointerEvent | WheelEvent): boolean {
    if (this.open_ || event.ctrlKey || ('pointerType' in event && event.pointerType !== 'touch'))
      return true;
    if (event.type === 'wheel') this.refused.emit();
    return false;
  }

  private set(open: boolean): void {
    this.open_ = open;
    this.view_.classList.toggle('scrolls-article', !open);
  }
}
