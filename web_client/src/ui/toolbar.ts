import type { CameraMode } from '../camera/mode';
import { is_typing } from '../input/view_input';
import type { WarpMode } from '../present/warp_policy';
import type { PictureSize } from '../session/quality';
import { text } from '../text';
import { by_id } from './dom';

export interface ToolbarListener {
  toggle_mode(): void;
  reset(): void;
  flip_up(): void;
  stats_shown(shown: boolean): void;
  share_shown(): void;
  quality(size: PictureSize, max_fps: number): void;
  warp(mode: WarpMode): void;
  fov_y_deg(value: number): void;
}

const panels = ['quality', 'stats', 'share', 'author', 'help'] as const;
type Panel = (typeof panels)[number];

// Here one panel leaves little of the picture to see.
const small_screen = '(max-width: 800px), (max-height: 500px)';
// Here a panel hides the tour's card: tour.css has the same.
const no_room_for_card = '(max-width: 1100px), (max-height: 500px)';

/** Buttons, their panels and their keys. */
export class Toolbar {
  private readonly fov_ = by_id('view-fov', HTMLInputElement);
  private readonly fov_value_ = by_id('view-fov-value', HTMLElement);
  private readonly bar_ = by_id('toolbar', HTMLElement);
  private readonly small_screen_ = matchMedia(small_screen);

  constructor(private readonly listener_: ToolbarListener) {
    const click = (id: string, action: () => void): void =>
      by_id(id, HTMLButtonElement).addEventListener('click', action);
    click('button-mode', () => listener_.toggle_mode());
    click('button-reset', () => listener_.reset());
    click('button-full', toggle_full_screen);
    click('view-flip', () => listener_.flip_up());
    for (const panel of panels) {
      click(`button-${panel}`, () => this.toggle(panel));
      hint_at_more(element_of(panel));
    }
    window.addEventListener('resize', () => {
      const open = panels.find((panel) => this.is_open(panel));
      if (open) this.close_beside(open);
    });
    by_id('button-full', HTMLButtonElement).hidden = !document.fullscreenEnabled;
    this.bind_quality();
    this.bind_keys();
    this.set_active(true);
  }

  /** Off while there is nothing to control: a card then says why. */
  set_active(active: boolean): void {
    this.bar_.inert = !active;
    if (!active) this.close_all();
  }

  open(panel: Panel): void {
    if (!this.is_open(panel)) this.toggle(panel);
  }

  /** For the picture and the tour's card, where panels would hide them. */
  make_room(): void {
    if (matchMedia(no_room_for_card).matches) this.close_all();
  }

  show_mode(mode: CameraMode): void {
    by_id('mode-label', HTMLElement).textContent = text.modes[mode];
    by_id('button-mode', HTMLButtonElement)
      .querySelector('use')
      ?.setAttribute('href', `#icon-${mode}`);
  }

  show_fov(fov_y_deg: number): void {
    this.fov_.value = String(Math.round(fov_y_deg));
    this.fov_value_.textContent = `${Math.round(fov_y_deg)}°`;
  }

  private bind_quality(): void {
    const size = by_id('quality-size', HTMLSelectElement);
    const fps = by_id('quality-fps', HTMLSelectElement);
    const changed = (): void =>
      this.listener_.quality(picture_size(size.value), Number(fps.value));
    size.addEventListener('change', changed);
    fps.addEventListener('change', changed);
    const warp = by_id('view-warp', HTMLSelectElement);
    warp.addEventListener('change', () => this.listener_.warp(warp.value as WarpMode));
    this.fov_.addEventListener('input', () => {
      this.listener_.fov_y_deg(this.fov_.valueAsNumber);
    });
  }

  private bind_keys(): void {
    const actions: Readonly<Record<string, () => void>> = {
      KeyM: () => this.listener_.toggle_mode(),
      KeyR: () => this.listener_.reset(),
      KeyU: () => this.listener_.flip_up(),
      KeyF: toggle_full_screen,
      KeyI: () => this.toggle('stats'),
      KeyH: () => this.toggle('help'),
      Escape: () => this.close_all(),
    };
    window.addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
      if (!this.bar_.inert && !is_typing(event.target)) actions[event.code]?.();
    });
  }

  private toggle(panel: Panel): void {
    const open = !this.is_open(panel);
    this.show(panel, open);
    if (open) this.close_beside(panel);
  }

  /** Closes what would lie under this panel, and on a small screen all else. */
  private close_beside(panel: Panel): void {
    const rect = element_of(panel).getBoundingClientRect();
    for (const other of panels) {
      if (other === panel || !this.is_open(other)) continue;
      const beside = element_of(other).getBoundingClientRect();
      if (this.small_screen_.matches || overlap(rect, beside)) this.show(other, false);
    }
  }

  private is_open(panel: Panel): boolean {
    return !element_of(panel).hidden;
  }

  private close_all(): void {
    for (const panel of panels) this.show(panel, false);
  }

  private show(panel: Panel, shown: boolean): void {
    element_of(panel).hidden = !shown;
    by_id(`button-${panel}`, HTMLButtonElement).setAttribute('aria-expanded', String(shown));
    if (panel === 'stats') this.listener_.stats_shown(shown);
    if (panel === 'share' && shown) this.listener_.share_shown();
  }
}

const picture_size = (value: string): PictureSize =>
  value === 'auto' || value === 'sharp' || value === 'smooth' ? value : Number(value);

const element_of = (panel: Panel): HTMLElement => by_id(`${panel}-panel`, HTMLElement);

function overlap(a: DOMRect, b: DOMRect): boolean {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

/** Lets panels.css show that a panel goes on below: phones show no scroll bars. */
function hint_at_more(panel: HTMLElement): void {
  const look = (): void => {
    const below_px = panel.scrollHeight - panel.clientHeight - panel.scrollTop;
    panel.classList.toggle('more-below', below_px > 1);
  };
  panel.addEventListener('scroll', look, { passive: true });
  new ResizeObserver(look).observe(panel);
}

function toggle_full_screen(): void {
  const change = document.fullscreenElement
    ? document.exitFullscreen()
    : document.documentElement.requestFullscreen();
  change.catch((error: unknown) => console.warn('full screen refused', error));
}
