import type { CameraMode } from '../camera/camera_controller';
import { is_typing } from '../input/view_input';
import { by_id } from './dom';

export interface ToolbarListener {
  toggle_mode(): void;
  reset(): void;
  flip_up(): void;
  stats_shown(shown: boolean): void;
  /** `height`: of the picture; 0 = the view's, 'auto' = what the server can keep up with. */
  quality(height: number | 'auto', max_fps: number): void;
  fov_y_deg(value: number): void;
}

const panels = ['quality', 'stats', 'help'] as const;
type Panel = (typeof panels)[number];

/** Buttons, their panels and their keys. */
export class Toolbar {
  private readonly fov_ = by_id('view-fov', HTMLInputElement);
  private readonly fov_value_ = by_id('view-fov-value', HTMLElement);

  constructor(private readonly listener_: ToolbarListener) {
    const click = (id: string, action: () => void): void =>
      by_id(id, HTMLButtonElement).addEventListener('click', action);
    click('button-mode', () => listener_.toggle_mode());
    click('button-reset', () => listener_.reset());
    click('button-full', toggle_full_screen);
    click('view-flip', () => listener_.flip_up());
    for (const panel of panels) click(`button-${panel}`, () => this.toggle(panel));
    by_id('button-full', HTMLButtonElement).hidden = !document.fullscreenEnabled;
    this.bind_quality();
    this.bind_keys();
  }

  show_mode(mode: CameraMode): void {
    by_id('mode-label', HTMLElement).textContent = mode === 'fly' ? 'Fly' : 'Orbit';
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
      this.listener_.quality(
        size.value === 'auto' ? 'auto' : Number(size.value),
        Number(fps.value),
      );
    size.addEventListener('change', changed);
    fps.addEventListener('change', changed);
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
      Escape: () => {
        for (const panel of panels) this.show(panel, false);
      },
    };
    window.addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
      if (!is_typing(event.target)) actions[event.code]?.();
    });
  }

  private toggle(panel: Panel): void {
    const open = by_id(`${panel}-panel`, HTMLElement).hidden;
    // Menus share a corner; statistics have their own.
    if (open && panel !== 'stats') {
      this.show('quality', false);
      this.show('help', false);
    }
    this.show(panel, open);
  }

  private show(panel: Panel, shown: boolean): void {
    by_id(`${panel}-panel`, HTMLElement).hidden = !shown;
    by_id(`button-${panel}`, HTMLButtonElement).setAttribute('aria-expanded', String(shown));
    if (panel === 'stats') this.listener_.stats_shown(shown);
  }
}

function toggle_full_screen(): void {
  const change = document.fullscreenElement
    ? document.exitFullscreen()
    : document.documentElement.requestFullscreen();
  change.catch((error: unknown) => console.warn('full screen refused', error));
}
