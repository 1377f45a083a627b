import { load_part } from '../base/load_part';
import { Signal } from '../base/signal';
import type { Vec3 } from '../base/vector';
import type { Clip, ClipPlane } from '../camera/eye';
import type { Section } from '../camera/section';
import type { WorkerClient } from '../worker/client';
import type { Navigation } from './navigation';

/** What of the scene is drawn: what is in the visitor's section, and under the ceiling of a dollhouse. */
export class Clipping {
  /** The section has changed. */
  readonly changed = new Signal();
  private section_: Section | undefined;
  private up_: Vec3 = [0, -1, 0]; // that the section is about
  private ceiling_: ClipPlane | undefined;
  private told_ = 0; // to the server, how many times
  private failed_ = false; // the server was away

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
    worker_.on('welcome', () => {
      if (this.failed_) this.tell();
    });
  }

  /** It is about the visitor's up. */
  get section(): Section | undefined {
    return this.section_;
  }

  set section(section: Section | undefined) {
    if (section !== this.section_) this.put(section, this.navigation_.camera.up);
  }

  /** The visitor changes the section. */
  edit(section: Section | undefined): void {
    this.navigation_.taken_over.emit();
    this.section = section;
  }

  /** Shows a section about the scene's own up, as stops have it. */
  show(section: Section | undefined): void {
    this.put(section, this.navigation_.own_up);
  }

  set ceiling(plane: ClipPlane | undefined) {
    this.ceiling_ = plane;
    this.tell();
  }

  private put(section: Section | undefined, up: Vec3): void {
    this.section_ = section;
    this.up_ = up;
    this.tell();
    this.changed.emit();
  }

  /** The section stays where it is when another way is up. */
  private tell(): void {
    const { section_: section, ceiling_: ceiling } = this;
    const told = ++this.told_;
    const post = (clip: Clip | undefined): void => this.worker_.post({ kind: 'clip', clip });
    this.failed_ = false;
    if (!section) return post(ceiling);
    load_part(() => import('../camera/upright_box')).then(
      ({ clip_box, section_about }) => {
        if (told !== this.told_) return;
        const { up } = this.navigation_.camera;
        const turned = section_about(section, this.up_, up);
        if (turned !== section) this.put(turned, up);
        else post(clip_box(section, up, ceiling));
      },
      (error: unknown) => {
        this.failed_ = told === this.told_; // the server is away
        console.warn('the section cannot be shown', error);
      },
    );
  }
}
