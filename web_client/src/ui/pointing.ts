// Pointing at places of the scene, for all in a company: by a long press, by Alt and a click, or at the middle.
import type { Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { direction_to, place_of } from '../camera/ray';
import { by_id, make, on_click } from '../page/dom';
import type { PageParts } from '../page/parts';
import { text } from '../text/text';

const { guide: words } = text;
const long_press_ms = 600;
const slack_px = 10; // fingers tremble
const shown_ms = 5000;
const most_shown = 8;
const edge = 0.44; // of the view's sides, from its middle

interface Shown {
  readonly place: Vec3;
  readonly ring: HTMLElement;
}

export class Pointing {
  private readonly button_ = by_id('company-point', HTMLButtonElement);
  private readonly host_ = by_id('pings', HTMLElement);
  private allowed_ = false;
  private press_: { readonly x: number; readonly y: number; readonly timer: ReturnType<typeof setTimeout> } | undefined;
  private shown_: readonly Shown[] = [];
  private eye_: Eye | undefined; // of the picture that the visitor sees
  private picture_aspect_ = 0;

  constructor(private readonly parts_: Pick<PageParts, 'view' | 'worker' | 'navigation' | 'notice' | 'seen'>) {
    const { worker, seen } = parts_;
    worker.on('pinged', ({ place, by_leader, name }) => this.show(place, by_leader ? words.by_leader({ name }) : words.by_other));
    worker.on('config', ({ config }) => (this.picture_aspect_ = config.widthPx / Math.max(1, config.heightPx)));
    seen.moved.listen((eye) => this.see(eye));
    on_click('company-point', () => void this.point_at(0.5, 0.5));
    this.bind_presses();
  }

  /** Whether this visitor may point at places now. */
  set allowed(allowed: boolean) {
    this.allowed_ = allowed;
    this.button_.hidden = !allowed;
    if (!allowed) this.end_press();
  }

  /** The camera of the leader's picture, which this visitor watches. It has its own shape, and is all in the view. */
  watch(eye: Eye): void {
    const { clientWidth, clientHeight } = this.parts_.view;
    const taller = Math.max(1, (this.picture_aspect_ * clientHeight) / Math.max(1, clientWidth));
    this.see({ ...eye, fov_y_rad: 2 * Math.atan(Math.tan(eye.fov_y_rad / 2) * taller) });
  }

  private see(eye: Eye): void {
    this.eye_ = eye;
    for (const shown of this.shown_) this.put(shown, eye);
  }

  private bind_presses(): void {
    const { view } = this.parts_;
    const capture = { capture: true };
    view.addEventListener(
      'pointerdown',
      (event) => {
        this.end_press();
        if (!this.allowed_ || !event.isPrimary || event.button !== 0) return;
        const { clientX: x, clientY: y } = event;
        if (event.altKey) {
          event.stopImmediatePropagation();
          void this.point_at(...this.share_of(x, y));
          return;
        }
        const timer = setTimeout(() => {
          this.press_ = undefined;
          // For the camera the press is over: it is no tap, too.
          view.dispatchEvent(new PointerEvent('pointercancel', { pointerId: event.pointerId }));
          void this.point_at(...this.share_of(x, y));
        }, long_press_ms);
        this.press_ = { x, y, timer };
      },
      capture,
    );
    view.addEventListener(
      'pointermove',
      (event) => {
        if (!this.press_) return;
        // Until it is a drag, the camera hears nothing of it: a follower's would leave the leader.
        if (Math.hypot(event.clientX - this.press_.x, event.clientY - this.press_.y) > slack_px) this.end_press();
        else event.stopImmediatePropagation();
      },
      capture,
    );
    for (const end of ['pointerup', 'pointercancel']) view.addEventListener(end, () => this.end_press(), capture);
  }

  private end_press(): void {
    clearTimeout(this.press_?.timer);
    this.press_ = undefined;
  }

  private share_of(x: number, y: number): [number, number] {
    const { left, top, width, height } = this.parts_.view.getBoundingClientRect();
    return [(x - left) / width, (y - top) / height];
  }

  private async point_at(x: number, y: number): Promise<void> {
    const mark = await this.parts_.navigation.hit_at(x, y);
    if (mark) this.parts_.worker.post({ kind: 'ping', place: mark.point });
    else this.parts_.notice.show(words.nothing_there, 4);
  }

  private show(place: Vec3, said: string): void {
    const ring = make('span', { className: 'ping' });
    const shown = { place, ring };
    this.shown_ = [...this.shown_, shown];
    for (const { ring: old } of this.shown_.slice(0, -most_shown)) old.remove();
    this.shown_ = this.shown_.slice(-most_shown);
    this.host_.append(ring);
    const inside = this.put(shown, this.eye_ ?? this.parts_.navigation.eye);
    // The ring tells all others.
    by_id('company-said', HTMLElement).textContent = inside ? said : `${said}. ${words.aside}`;
    setTimeout(() => {
      if (this.shown_[this.shown_.length - 1] === shown) by_id('company-said', HTMLElement).textContent = '';
      ring.remove();
      this.shown_ = this.shown_.filter((other) => other !== shown);
    }, shown_ms);
  }

  /** Puts the ring where the place is, or an arrow at the edge. Returns whether the place is in the picture. */
  private put({ place, ring }: Shown, eye: Eye): boolean {
    const { clientWidth: width_px, clientHeight: height_px } = this.parts_.view;
    const at = place_of(place, eye, width_px / height_px);
    const inside = at !== undefined && at.every((share) => share > 0 && share < 1);
    ring.classList.toggle('aside', !inside);
    const [right, down] = direction_to(place, eye);
    const reach = edge / Math.max(Math.abs(right), Math.abs(down), 1e-6);
    const [x, y] = inside ? at : [0.5 + right * reach, 0.5 + down * reach];
    ring.style.transform = `translate(${(x * width_px).toFixed(1)}px, ${(y * height_px).toFixed(1)}px) rotate(${inside ? 0 : Math.atan2(down, right)}rad)`;
    return inside;
  }
}
