import type { Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import type { SceneSetup } from '../camera/scene_setup';
import { text } from '../text';
import { TourDraft } from '../tour/draft';
import { max_text_characters } from '../tour/limits';
import { save_sidecar, type SidecarTag } from '../tour/save';
import type { Stop, Tour } from '../tour/tour';
import { by_id, make, on_click, save_file } from './dom';

interface AuthorTools {
  eye(): Eye;
  scene(): SceneSetup | undefined;
  scene_id(): string;
  file_name(): string; // of the scene, without extension
  /** The point in the middle of the view; undefined: nothing is there. */
  place_ahead(): Promise<Vec3 | undefined>;
  /** The tours have changed. */
  changed(tours: readonly Tour[]): void;
  go_to(stop_index: number): void;
  /** Plays the tour as it is so far. */
  preview(): void;
  /** Sets where visits begin, for this page. */
  start_at(eye: Eye): void;
}

/** The editor of tours: `?author` in the address. */
export class AuthorPanel {
  private readonly draft_ = new TourDraft();
  private readonly list_ = by_id('author-stops', HTMLOListElement);
  private readonly title_ = by_id('author-title', HTMLInputElement);
  private readonly autoplay_ = by_id('author-autoplay', HTMLInputElement);
  private readonly preview_ = by_id('author-preview', HTMLButtonElement);
  private readonly save_ = by_id('author-save', HTMLButtonElement);
  private readonly replace_ = by_id('author-replace', HTMLButtonElement);
  private readonly done_ = by_id('author-done', HTMLOutputElement);
  private token_: string | undefined;
  private made_from_: SidecarTag;
  private theirs_: SidecarTag; // tag of what somebody else saved meanwhile
  private open_ = 0; // index of the stop that is shown with all its fields
  private changes_ = 0;
  private saved_changes_ = 0;

  constructor(private readonly tools_: AuthorTools) {
    by_id('button-author', HTMLButtonElement).hidden = false;
    on_click('author-add', () => void this.add());
    on_click('author-start', () => {
      tools_.start_at(tools_.eye());
      this.scene_changed();
      this.done_.textContent = text.author.start_set;
    });
    on_click('author-preview', () => tools_.preview());
    on_click('author-save', () => void this.save(this.made_from_));
    on_click('author-replace', () => void this.save(this.theirs_));
    on_click('author-download', () => this.download());
    this.title_.addEventListener('input', () => {
      this.draft_.title = this.title_.value;
      this.told();
    });
    this.autoplay_.addEventListener('change', () => {
      this.draft_.starts_itself = this.autoplay_.checked;
      this.told();
    });
    window.addEventListener('beforeunload', (event) => {
      if (this.changes_ > this.saved_changes_) event.preventDefault();
    });
  }

  /**
   * `token`: lets its holder save the sidecar; undefined: this visitor may not save.
   * `made_from`: the tag of the sidecar with these tours.
   */
  load(tours: readonly Tour[], token: string | undefined, made_from: SidecarTag): void {
    this.token_ = token;
    this.made_from_ = made_from;
    this.save_.hidden = token === undefined;
    this.replace_.hidden = true;
    this.draft_.load(tours);
    this.title_.value = this.draft_.title;
    this.autoplay_.checked = this.draft_.starts_itself;
    this.changes_ = this.saved_changes_ = 0;
    this.show();
  }

  /** Where visits begin, or which way is up, is no longer as it was saved. */
  scene_changed(): void {
    this.changes_ += 1;
    this.done_.textContent = '';
  }

  private async add(): Promise<void> {
    const eye = this.tools_.eye();
    const marker = await this.tools_.place_ahead();
    const title = text.tour.stop_numbered(this.draft_.stops.length + 1);
    this.draft_.add({ title, caption: '', eye, marker, stay_s: undefined });
    this.open_ = this.draft_.stops.length - 1;
    this.edited();
    this.done_.textContent = marker ? '' : text.author.no_marker;
    this.list_.lastElementChild?.scrollIntoView({ block: 'nearest' });
    this.list_.lastElementChild?.querySelector('input')?.select();
  }

  private sidecar(): string | undefined {
    const scene = this.tools_.scene();
    return scene && `${JSON.stringify(this.draft_.sidecar(scene), undefined, 2)}\n`;
  }

  private async save(made_from: SidecarTag): Promise<void> {
    const sidecar = this.sidecar();
    if (sidecar === undefined || this.token_ === undefined) return;
    const { changes_: changes } = this;
    this.save_.disabled = this.replace_.disabled = true;
    this.done_.textContent = text.author.saving;
    const result = await save_sidecar(
      location.href,
      this.token_,
      this.tools_.scene_id(),
      sidecar,
      made_from,
      text.author.unreachable,
    );
    this.save_.disabled = this.replace_.disabled = false;
    if (result.kind === 'saved') {
      this.saved_changes_ = changes;
      this.made_from_ = result.tag;
      this.replace_.hidden = true;
      this.done_.textContent = text.author.saved;
    } else if (result.kind === 'changed') {
      this.theirs_ = result.tag;
      this.replace_.hidden = false;
      this.done_.textContent = text.author.changed_meanwhile;
    } else this.done_.textContent = text.author.not_saved(result.why);
  }

  private download(): void {
    const sidecar = this.sidecar();
    if (sidecar === undefined) return;
    const name = `${this.tools_.file_name()}.json`;
    save_file(new Blob([sidecar], { type: 'application/json' }), name);
    this.saved_changes_ = this.changes_;
    this.done_.textContent =
      this.token_ === undefined ? text.author.downloaded(name) : text.author.downloaded_too(name);
  }

  private edited(): void {
    this.told();
    this.show();
  }

  private told(): void {
    this.changes_ += 1;
    this.done_.textContent = '';
    this.tools_.changed(this.draft_.tours);
  }

  private show(): void {
    const count = this.draft_.stops.length;
    by_id('author-hint', HTMLElement).hidden = count > 0;
    this.preview_.disabled = count === 0;
    this.list_.replaceChildren(...this.draft_.stops.map((stop, i) => this.row_of(stop, i)));
  }

  /** The fields and buttons of a stop. */
  private row_of(stop: Stop, i: number): HTMLElement {
    const words = text.author;
    const title = make('input', { value: stop.title, maxLength: 200, 'aria-label': words.title(i + 1) });
    title.addEventListener('input', () => this.change(i, { title: title.value }));
    const caption = make('textarea', {
      ...{ value: stop.caption, rows: 2, maxLength: max_text_characters },
      ...{ placeholder: words.caption_here, 'aria-label': words.caption(i + 1) },
    });
    caption.addEventListener('input', () => this.change(i, { caption: caption.value }));
    const button = (name: string, onclick: () => void, sign = name, disabled = false): HTMLElement => {
      const said = sign === name ? {} : { 'aria-label': name, title: name };
      return make('button', { type: 'button', disabled, onclick, ...said }, sign);
    };
    const buttons = make(
      'div',
      {},
      button(words.show, () => this.tools_.go_to(i)),
      button(words.view_here, () => void this.view_here(i)),
      button(words.up(i + 1), () => this.move(i, -1), '↑', i === 0),
      button(words.down(i + 1), () => this.move(i, 1), '↓', i === this.draft_.stops.length - 1),
      button(words.remove(i + 1), () => this.remove(i), '×'),
    );
    const item = make('li', {}, title, caption, buttons);
    item.classList.toggle('open', i === this.open_);
    item.addEventListener('focusin', () => this.open(i));
    return item;
  }

  private change(index: number, change: { title?: string; caption?: string }): void {
    this.draft_.change(index, change);
    this.told(); // does not rebuild the fields, so that they keep their focus
  }

  private async view_here(index: number): Promise<void> {
    const eye = this.tools_.eye();
    this.draft_.change(index, { eye, marker: await this.tools_.place_ahead() });
    this.edited();
  }

  private remove(index: number): void {
    this.draft_.remove(index);
    this.edited();
  }

  private open(index: number): void {
    this.open_ = index;
    [...this.list_.children].forEach((item, i) => item.classList.toggle('open', i === index));
  }

  private move(index: number, by: number): void {
    this.draft_.move(index, by);
    this.open_ = index + by;
    this.edited();
  }
}
