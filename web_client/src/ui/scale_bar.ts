import type { Eye } from '../camera/eye';
import { bar_within, type Scale } from '../measure/units';
import { make } from '../page/dom';
import { text } from '../text/text';

const longest_px = 160;
const share_of_view = 0.35;

/** A round length beside an orthographic picture. */
export class ScaleBar {
  private readonly text_ = make('span');
  private readonly bar_ = make('div', { id: 'scale-bar', role: 'img', hidden: true }, this.text_);

  constructor(
    private readonly view_: HTMLElement,
    private readonly scale_: () => Scale,
  ) {
    view_.after(this.bar_);
  }

  draw({ view_height }: Eye): void {
    this.bar_.hidden = view_height === undefined;
    if (view_height === undefined) return;
    const { clientWidth, clientHeight } = this.view_;
    const px = Math.max(1, clientHeight) / view_height;
    const most_px = Math.min(longest_px, share_of_view * clientWidth);
    const bar = bar_within(most_px / px, this.scale_());
    this.bar_.style.width = `${(bar.length * px).toFixed(1)}px`;
    if (this.text_.textContent === bar.text) return;
    this.text_.textContent = bar.text;
    this.bar_.setAttribute('aria-label', text.views.scale({ length: bar.text }));
  }
}
