import { load_part } from '../base/load_part';
import { Signal } from '../base/signal';
import type { Clip, ClipPlane } from '../camera/eye';
import type { Section } from '../camera/section';
import type { WorkerClient } from '../worker/client';
import type { Navigation } from './navigation';

/** What of the scene is drawn: what is in the visitor's section, and under the ceiling of a dollhouse. */
export class Clipping {
  /** The section has changed. */
  readonly changed = new Signal();
  private section_: Section | undefined;
  private ceiling_: ClipPlane | undefined;
  private told_ = 0; // to the server, how many times

  constructor(
    private readonly worker_: WorkerClient,
    private readonly navigation_: Navigation,
  ) {
    navigation_.entered.listen(() => {
      this.section_ = this.ceiling_ = undefined; // a new scene is drawn as a whole
      this.told_ += 1;
      this.changed.emit();
    });
    navigation_.up_changed.listen(() => this.tell());
  }

  get section(): Section | undefined {
    return this.section_;
  }

  set section(section: Section | undefined) {
    if (section === this.section_) return;
    this.section_ = section;
    this.tell();
    this.changed.emit();
  }

  set ceiling(plane: ClipPlane | undefined) {
    this.ceiling_ = plane;
    this.tell();
  }

  private tell(): void {
    const { section_: section, ceiling_: ceiling } = this;
    const told = ++this.told_;
    const post = (clip: Clip | undefined): void => {
      if (told === this.told_) this.worker_.post({ kind: 'clip', clip });
    };
    if (!section) return post(ceiling);
    load_part(() => import('../camera/upright_box')).then(
      ({ clip_box }) => post(clip_box(section, this.navigation_.camera.up, ceiling)),
      (error: unknown) => console.warn('the section cannot be shown', error), // the server is away
    );
  }
}
