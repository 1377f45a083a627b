import { Signal } from '../base/signal';
import type { CameraMode } from '../camera/mode';
import { is_for_page, letter_of } from '../input/key';
import { text } from '../text/text';
import { by_id, hint_at_more, on_click } from './dom';
import type { Navigation } from './navigation';

const panels = ['quality', 'stats', 'measure', 'plan', 'views', 'share', 'author', 'help'] as const;
type Panel = (typeof panels)[number];

// Screens on which one panel covers most of the picture.
const small_screen = '(max-width: 800px), (max-height: 500px)';
// Screens on which a panel hides the tour's card. tour.css has the same.
const no_room_for_card = '(max-width: 1100px), (max-height: 500px)';

/** The buttons, their panels and their keys. */
export class Toolbar {
  readonly panel_shown = new Signal<{ panel: Panel; shown: boolean }>();
  private readonly bar_ = by_id('toolbar', HTMLElement);
  /** Whether another visitor moves the camera: then there is less to control. */
  watching = false;
  private work_: { readonly panel: Panel; readonly is_unsaved: () => boolean } | undefined;
  private readonly small_screen_ = matchMedia(small_screen);

  constructor(private readonly navigation_: Navigation) {
    on_click('button-mode', () => navigation_.next_mode());
    on_click('button-reset', () => navigation_.reset());
    on_click('button-full', toggle_full_screen);
    for (const panel of panels) {
      on_click(`button-${panel}`, () => this.toggle(panel));
      hint_at_more(element_of(panel));
    }
    window.addEventListener('resize', () => {
      const open = panels.find((panel) => this.is_open(panel));
      if (open) this.close_beside(open);
    });
    // A panel that grows may come over another one.
    const grown = new ResizeObserver((entries) => {
      for (const { target } of entries) {
        const panel = panels.find((name) => element_of(name) === target);
        if (panel && this.is_open(panel)) this.close_beside(panel);
      }
    });
    for (const panel of panels) grown.observe(element_of(panel));
    by_id('button-full', HTMLButtonElement).hidden = !document.fullscreenEnabled;
    navigation_.changed.listen(() => show_mode(navigation_.camera.mode));
    this.bind_keys();
    this.set_active(true);
  }

  /** Turns the toolbar off while there is nothing to control. A card then says why. */
  set_active(active: boolean): void {
    const kept = !active && this.work_?.is_unsaved() ? this.work_.panel : undefined;
    this.bar_.inert = !active && !kept;
    if (active) return;
    for (const panel of panels) if (panel !== kept) this.close(panel);
    if (kept) this.open(kept);
  }

  /** While this panel holds unsaved work, it stays usable, whatever becomes of the session. */
  keep_usable(panel: Panel, is_unsaved: () => boolean): void {
    this.work_ = { panel, is_unsaved };
  }

  open(panel: Panel): void {
    if (!this.is_open(panel)) this.toggle(panel);
  }

  close(panel: Panel): void {
    if (this.is_open(panel)) this.show(panel, false);
  }

  /** Closes panels where they hide the picture or the tour's card. */
  make_room(): void {
    if (matchMedia(no_room_for_card).matches) this.close_all();
  }

  private bind_keys(): void {
    const actions: Readonly<Record<string, () => void>> = {
      M: () => this.navigation_.next_mode(),
      R: () => this.navigation_.reset(),
      U: () => this.navigation_.turn_over(),
      F: toggle_full_screen,
      I: () => this.toggle('stats'),
      H: () => this.toggle('help'),
      Escape: () => this.close_all(),
    };
    const faster: Readonly<Record<string, number>> = { '+': 2, '=': 2, '-': -2, _: -2 };
    window.addEventListener('keydown', (event) => {
      // A key that moves the camera has been taken: on some layouts it bears one of these letters.
      if (this.bar_.inert || event.repeat || event.defaultPrevented || !is_for_page(event)) return;
      const letter = letter_of(event);
      if (this.watching && !['F', 'I', 'Escape'].includes(letter)) return;
      actions[letter]?.();
      // By its sign, because its position differs from layout to layout.
      const steps = faster[event.key];
      if (steps) this.navigation_.faster(steps);
    });
  }

  private toggle(panel: Panel): void {
    const open = !this.is_open(panel);
    this.show(panel, open);
    if (open) this.close_beside(panel);
  }

  /** Closes panels under this one, and all others on a small screen. */
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
    for (const panel of panels) this.close(panel);
  }

  private show(panel: Panel, shown: boolean): void {
    const element = element_of(panel);
    const button = by_id(`button-${panel}`, HTMLButtonElement);
    if (!shown && element.contains(document.activeElement)) button.focus(); // not lost with the panel
    element.hidden = !shown;
    button.setAttribute('aria-expanded', String(shown));
    this.panel_shown.emit({ panel, shown });
  }
}

function show_mode(mode: CameraMode): void {
  by_id('mode-label', HTMLElement).textContent = text.modes[mode];
  by_id('button-mode', HTMLButtonElement)
    .querySelector('use')
    ?.setAttribute('href', `#icon-${mode}`);
}

const element_of = (panel: Panel): HTMLElement => by_id(`${panel}-panel`, HTMLElement);

function overlap(a: DOMRect, b: DOMRect): boolean {
  return a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
}

function toggle_full_screen(): void {
  const change = document.fullscreenElement
    ? document.exitFullscreen()
    : document.documentElement.requestFullscreen();
  change.catch((error: unknown) => console.warn('full screen refused', error));
}
