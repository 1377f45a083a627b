import type { SceneSetup } from '../camera/camera_controller';
import type { Vec3 } from '../camera/vector';
import type { Eye } from '../present/warp';
import { TourDraft } from '../tour/draft';
import type { Tour } from '../tour/tour';
import { by_id } from './dom';
import { save_file } from './share_panel';
import { text } from './text';

export interface AuthorTools {
  eye(): Eye;
  scene(): SceneSetup | undefined;
  scene_id(): string;
  /** What is in the middle of the view. */
  place_ahead(): Promise<Vec3 | undefined>;
  /** The tours have changed. */
  changed(tours: readonly Tour[]): void;
  go_to(stop_index: number): void;
  /** From now on visits of this page begin there. */
  start_at(eye: Eye): void;
}

/** Where a tour is made: `?author` in the address. Nothing leaves the page but the saved file. */
export class AuthorPanel {
  private readonly draft_ = new TourDraft();
  private readonly list_ = by_id('author-stops', HTMLOListElement);
  private readonly title_ = by_id('author-title', HTMLInputElement);
  private readonly done_ = by_id('author-done', HTMLOutputElement);

  constructor(private readonly tools_: AuthorTools) {
    by_id('button-author', HTMLButtonElement).hidden = false;
    const click = (id: string, action: () => void): void =>
      by_id(id, HTMLButtonElement).addEventListener('click', action);
    click('author-add', () => void this.add());
    click('author-start', () => {
      this.draft_.start = tools_.eye();
      tools_.start_at(tools_.eye());
      this.done_.textContent = text.author.start_set;
    });
    click('author-save', () => this.save());
    this.title_.addEventListener('change', () => {
      this.draft_.title = this.title_.value;
      tools_.changed(this.draft_.tours);
    });
  }

  load(tours: readonly Tour[]): void {
    this.draft_.load(tours);
    this.title_.value = this.draft_.title;
    this.show();
  }

  private async add(): Promise<void> {
    const eye = this.tools_.eye();
    const marker = await this.tools_.place_ahead();
    const title = text.tour.stop_numbered(this.draft_.stops.length + 1);
    this.draft_.add({ title, caption: '', eye, marker, stay_s: undefined });
    this.edited();
    this.done_.textContent = marker ? '' : text.author.no_marker;
    this.list_.lastElementChild?.querySelector('input')?.select();
  }

  private save(): void {
    const scene = this.tools_.scene();
    if (!scene) return;
    const name = `${this.tools_.scene_id()}.json`;
    const sidecar = JSON.stringify(this.draft_.sidecar(scene), undefined, 2);
    save_file(new Blob([`${sidecar}\n`], { type: 'application/json' }), name);
    this.done_.textContent = text.author.saved(name);
  }

  private edited(): void {
    this.tools_.changed(this.draft_.tours);
    this.show();
  }

  private show(): void {
    const count = this.draft_.stops.length;
    this.list_.replaceChildren(
      ...this.draft_.stops.map((stop, i) => {
        const item = document.createElement('li');
        const title = document.createElement('input');
        title.value = stop.title;
        title.maxLength = 200;
        title.setAttribute('aria-label', text.author.title(i + 1));
        title.addEventListener('change', () => this.change(i, { title: title.value }));
        const caption = document.createElement('textarea');
        caption.value = stop.caption;
        caption.rows = 2;
        caption.maxLength = 4000;
        caption.placeholder = text.author.caption_here;
        caption.setAttribute('aria-label', text.author.caption(i + 1));
        caption.addEventListener('change', () => this.change(i, { caption: caption.value }));
        const buttons = document.createElement('div');
        const button = (name: string, action: () => void, enabled = true): void => {
          const made = document.createElement('button');
          made.type = 'button';
          made.textContent = name;
          made.disabled = !enabled;
          made.addEventListener('click', action);
          buttons.append(made);
        };
        button(text.author.show, () => this.tools_.go_to(i));
        button(text.author.view_here, () => void this.view_here(i));
        button(text.author.up, () => this.move(i, -1), i > 0);
        button(text.author.down, () => this.move(i, 1), i < count - 1);
        button(text.author.remove, () => {
          this.draft_.remove(i);
          this.edited();
        });
        item.append(title, caption, buttons);
        return item;
      }),
    );
  }

  private change(index: number, change: { title?: string; caption?: string }): void {
    this.draft_.change(index, change);
    this.tools_.changed(this.draft_.tours); // the fields stay as they are, with their focus
  }

  private async view_here(index: number): Promise<void> {
    const eye = this.tools_.eye();
    this.draft_.change(index, { eye, marker: await this.tools_.place_ahead() });
    this.edited();
  }

  private move(index: number, by: number): void {
    this.draft_.move(index, by);
    this.edited();
  }
}
