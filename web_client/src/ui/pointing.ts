// Points at something in the scene, for all in a shared tour: by a long press, by Alt and a click, or at the middle.
import type { Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { direction_to, project } from '../camera/ray';
import type { Pointed } from '../input/pointers';
import { by_id, make, on_click } from '../page/dom';
import type { PageParts } from '../page/parts';
import { text } from '../text/text';

const { pointing: words } = text;
const shown_ms = 5000;
const most_shown = 8;
const edge = 0.44; // of the view's sides, from its middle

interface Shown {
  readonly point: Vec3;
  readonly ring: HTMLElement;
}

export class Pointing {
  private readonly button_ = by_id('shared-tour-point', HTMLButtonElement);
  private readonly host_ = by_id('pings', HTMLElement);
  private shown_: readonly Shown[] = [];
  private eye_: Eye | undefined; // of the picture that the visitor sees

  constructor(
    private readonly parts_: Pick<PageParts, 'view' | 'worker' | 'navigation' | 'notice' | 'seen'>,
  ) {
    const { worker, seen } = parts_;
    worker.on('pinged', ({ point, by_host, name }) =>
      this.show(point, by_host ? words.by_host({ name }) : words.by_other),
    );
    seen.moved.listen((eye) => this.see(eye));
    on_click('shared-tour-point', () => void this.point_at(0.5, 0.5));
  }

  /** Whether this visitor may point now. */
  set allowed(allowed: boolean) {
    const { gestures } = this.parts_.navigation;
    this.button_.hidden = !allowed;
    if (allowed) gestures.set('point', this.take);
    else gestures.remove('point');
  }

  private readonly take = ({ x, y, how }: Pointed): boolean => {
    if (how === 'press') void this.point_at(x, y);
    return how === 'press';
  };

  private see(eye: Eye): void {
    this.eye_ = eye;
    for (const shown of this.shown_) this.put(shown, eye);
  }

  private async point_at(x: number, y: number): Promise<void> {
    const mark = await this.parts_.navigation.hit_at(x, y);
    if (mark) this.parts_.worker.post({ kind: 'ping', point: mark.point });
    else this.parts_.notice.show(words.nothing_there, 4);
  }

  private show(point: Vec3, said: string): void {
    const ring = make('span', { className: 'ping' });
    const shown = { point, ring };
    this.shown_ = [...this.shown_, shown];
    for (const { ring: old } of this.shown_.slice(0, -most_shown)) old.remove();
    this.shown_ = this.shown_.slice(-most_shown);
    this.host_.append(ring);
    const inside = this.put(shown, this.eye_ ?? this.parts_.navigation.eye);
    // The ring tells all others.
    by_id('shared-tour-said', HTMLElement).textContent = inside ? said : `${said}. ${words.aside}`;
    setTimeout(() => {
      if (this.shown_[this.shown_.length - 1] === shown)
        by_id('shared-tour-said', HTMLElement).textContent = '';
      ring.remove();
      this.shown_ = this.shown_.filter((other) => other !== shown);
    }, shown_ms);
  }

  /** Puts the ring where the point is, or an arrow at the edge. Returns whether the point is in the picture. */
  private put({ point, ring }: Shown, eye: Eye): boolean {
    const { clientWidth: width_px, clientHeight: height_px } = this.parts_.view;
    const at = project(point, eye, width_px / height_px);
    const inside = at !== undefined && at.every((share) => share > 0 && share < 1);
    ring.classList.toggle('aside', !inside);
    const [right, down] = direction_to(point, eye);
    const reach = edge / Math.max(Math.abs(right), Math.abs(down), 1e-6);
    const [x, y] = inside ? at : [0.5 + right * reach, 0.5 + down * reach];
    ring.style.transform = `translate(${(x * width_px).toFixed(1)}px, ${(y * height_px).toFixed(1)}px) rotate(${inside ? 0 : Math.atan2(down, right)}rad)`;
    return inside;
  }
}
