import type { Eye } from '../camera/eye';
import type { Section } from '../camera/section';
import type { Clipping } from '../page/clipping';
import type { Navigation } from '../page/navigation';
import type { Toolbar } from '../page/toolbar';
import type { TourPlayer } from '../tour/player';

/** Plays an author's tour once. At its end, or by Escape, the author is back where the preview began. */
export class Preview {
  private from_: { readonly eye: Eye; readonly section: Section | undefined } | undefined;

  constructor(
    private readonly player_: TourPlayer,
    private readonly toolbar_: Toolbar,
    private readonly navigation_: Navigation,
    private readonly clipping_: Clipping,
  ) {
    window.addEventListener(
      'keydown',
      (event) => {
        if (event.key !== 'Escape' || !this.from_) return;
        event.stopImmediatePropagation(); // it would close the panel
        this.end();
      },
      { capture: true },
    );
  }

  begin(): void {
    this.from_ = { eye: this.navigation_.eye, section: this.clipping_.section };
    this.toolbar_.make_room();
    this.player_.play_once(() => this.end());
  }

  /** The author continues from here, so that Escape leads nowhere. */
  forget(): void {
    this.from_ = undefined;
  }

  private end(): void {
    const from = this.from_;
    this.from_ = undefined;
    this.player_.leave();
    if (from) {
      this.clipping_.section = from.section;
      this.navigation_.put_back(from.eye);
    }
    this.toolbar_.open('author');
    document.getElementById('author-preview')?.focus();
  }
}
