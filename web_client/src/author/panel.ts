import { load_part } from '../base/load_part';
import type { Eye } from '../camera/eye';
import { by_id, on_click, save_file } from '../page/dom';
import type { PageParts } from '../page/parts';
import { file_name_of, type SceneListing } from '../session/scenes';
import { text } from '../text/text';
import { texts_written } from '../text/translations';
import { TourDraft, type SceneAbout } from '../tour/draft';
import { max_measures, max_tours } from '../tour/limits';
import type { MeasureList } from '../tour/measure_list';
import { without, type Measure } from '../tour/measures';
import type { TourPlayer } from '../tour/player';
import { save_sidecar, type SidecarTag } from '../tour/save';
import { tours_for, type Stop, type Tour } from '../tour/tour';
import { untranslated, worded, words_for } from '../tour/words';
import { AuthorAbout, no_scene_words } from './about';
import type { FilmPanel } from './film_panel';
import { AuthorLanguage } from './language';
import type { Preview } from './preview';
import { AuthorStops, type MediaFields, type StopActions } from './stops';

interface AuthorTools extends Pick<PageParts, 'navigation' | 'clipping'> {
  readonly player: TourPlayer;
  readonly preview: Preview;
  /** What is drawn, as stops have it. */
  section(): Stop['section'];
  /** The scenes that this author may see. */
  scenes(): Promise<readonly SceneListing[]>;
  /** The tours have changed. `edited`: index of the one that is edited; -1: it has no stops. */
  changed(tours: readonly Tour[], edited: number): void;
  readonly media: MediaFields;
  readonly measures: MeasureList;
  /** Sets where visits begin, for this page; undefined: where they began before. */
  start_at(eye: Eye | undefined): void;
}

/** The editor of tours: `?author` in the address. */
export class AuthorPanel {
  private readonly draft_ = new TourDraft();
  private readonly about_: AuthorAbout;
  private readonly stops_: AuthorStops;
  private readonly language_ = new AuthorLanguage(() => this.edited());
  private readonly tour_ = by_id('author-tour', HTMLSelectElement);
  private readonly title_ = by_id('author-title', HTMLInputElement);
  private readonly autoplay_ = by_id('author-autoplay', HTMLInputElement);
  private readonly save_ = by_id('author-save', HTMLButtonElement);
  private readonly replace_ = by_id('author-replace', HTMLButtonElement);
  /** What came of editing is said where the author edits, and what came of saving beside its buttons. */
  private readonly said_ = by_id('author-said', HTMLOutputElement);
  private readonly done_ = by_id('author-done', HTMLOutputElement);
  private film_: FilmPanel | undefined;
  private token_: string | undefined;
  private scene_id_: string | undefined; // of the draft
  private made_from_: SidecarTag;
  private theirs_: SidecarTag; // tag of what somebody else saved meanwhile
  private start_: Eye | undefined; // as the page has heard
  private points_: Promise<unknown> = Promise.resolve(); // all that edits have asked for are known
  private saved_: unknown = this.draft_.state; // the state of the draft that is saved; undefined: the scene has changed besides

  constructor(private readonly tools_: AuthorTools) {
    by_id('button-author', HTMLButtonElement).hidden = false;
    this.about_ = new AuthorAbout((change, field) =>
      this.edit_about(this.about_change(change), this.typed_in(field)),
    );
    this.stops_ = new AuthorStops(
      by_id('author-stops', HTMLOListElement),
      this.stop_actions(),
      tools_.media,
    );
    this.bind();
  }

  private stop_actions(): StopActions {
    const { tools_: tools } = this;
    return {
      stop: (i) => this.draft_.stops[i]!,
      change: (i, change, field) => {
        this.draft_.change(
          i,
          worded(this.draft_.stops[i]!, this.language_.value, change),
          this.typed_in(field),
        );
        // Typing does not rebuild the fields.
        if (field === undefined) this.edited();
        else this.told();
      },
      go_to: (i) => tools.player.go_to(i),
      take_view: (i) => void this.take_view(i),
      take_marker: (i) => void this.take_marker(i),
      move: (i, by) => {
        this.draft_.move(i, by);
        this.edited(i + by);
      },
      remove: (i) => this.remove(i),
    };
  }

  /**
   * `token`: lets its holder save the sidecar; undefined: this visitor may not save.
   * `made_from`: the tag of the sidecar with these tours and measures. All measures are the author's own.
   */
  load(
    tours: readonly Tour[],
    about: SceneAbout,
    token: string | undefined,
    made_from: SidecarTag,
    measures: readonly Measure[],
  ): void {
    this.token_ = token;
    this.scene_id_ = this.tools_.navigation.scene_id;
    this.film_?.look();
    this.made_from_ = made_from;
    this.save_.hidden = token === undefined;
    const visits = by_id('author-visits', HTMLAnchorElement);
    visits.hidden = token === undefined;
    visits.href = `visits?scene=${encodeURIComponent(this.tools_.navigation.scene_id)}`;
    this.replace_.hidden = true;
    this.tools_.media.use(this.tools_.navigation.scene_id, token);
    const own = [...measures, ...without(this.tools_.measures.own, measures)].slice(
      0,
      max_measures,
    );
    this.draft_.load(tours, about, own);
    this.tools_.measures.enter(own, []);
    this.language_.offer(tours, about);
    this.saved_ = this.draft_.state;
    this.start_ = undefined;
    this.show(0);
    void this.tools_.scenes().then((scenes) => {
      this.stops_.offer(scenes, this.tools_.navigation.scene_id);
      this.show();
    });
  }

  /** The change in the language that is edited. */
  private about_change({ title, credits, ...other }: Partial<SceneAbout>): Partial<SceneAbout> {
    const words = {
      ...(title !== undefined && { title }),
      ...(credits !== undefined && { credits }),
    };
    if (Object.keys(words).length === 0) return other;
    const { about } = this.draft_.state;
    return { ...other, ...texts_written(about, this.language_.value, words, no_scene_words) };
  }

  edit_about(change: Partial<SceneAbout>, field?: string): void {
    this.draft_.edit_about(change, field);
    this.told();
  }

  get is_unsaved(): boolean {
    return this.saved_ !== this.draft_.state;
  }

  /** Which way is up is no longer as it was saved. */
  scene_changed(): void {
    this.saved_ = undefined;
    this.say('');
  }

  private bind(): void {
    const { draft_: draft, tools_: tools } = this;
    on_click('author-undo', () => {
      draft.undo();
      this.edited();
    });
    on_click('author-new', () => {
      draft.add_tour();
      this.edited(0);
      this.title_.focus();
    });
    on_click('author-delete', () => {
      draft.remove_tour();
      this.edited(0);
      this.title_.focus();
    });
    this.tour_.addEventListener('change', () => {
      const was_unsaved = this.is_unsaved;
      draft.choose(Number(this.tour_.value));
      if (!was_unsaved) this.saved_ = draft.state;
      this.edited(0);
    });
    this.title_.addEventListener('input', () => {
      draft.edit_tour(
        worded(draft.tour, this.language_.value, { title: this.title_.value }),
        this.typed_in('tour'),
      );
      this.told();
    });
    on_click('author-add', () => void this.add());
    tools.measures.changed.listen((field) => this.measured(field));
    on_click('author-start', () => {
      draft.edit({ start: tools.navigation.camera.perspective_eye });
      this.told();
      this.say(text.author.start_set);
    });
    on_click('author-preview', () => tools.preview.begin());
    this.autoplay_.addEventListener('change', () => {
      draft.edit_tour({ starts_itself: this.autoplay_.checked });
      this.told();
    });
    by_id('author-film', HTMLDetailsElement).addEventListener('toggle', () => {
      this.open_film().catch((error: unknown) => console.warn('films cannot be ordered', error));
    });
    on_click('author-save', () => void this.known().then(() => this.save(this.made_from_)));
    on_click('author-replace', () => void this.known().then(() => this.save(this.theirs_)));
    on_click('author-download', () => void this.known().then(() => this.download()));
    window.addEventListener('beforeunload', (event) => {
      if (this.is_unsaved) event.preventDefault();
    });
  }

  private async open_film(): Promise<void> {
    const fields = by_id('author-film-fields', HTMLElement);
    const { FilmPanel } = await load_part(() => import('./film_panel'));
    if (this.film_) return this.film_.look();
    this.film_ = new FilmPanel(fields, {
      navigation: this.tools_.navigation,
      clipping: this.tools_.clipping,
      tour: () => this.draft_.tour,
      token: () => this.token_,
    });
  }

  /** Resolves when all points that edits and measures have asked for are known. */
  private known(): Promise<unknown> {
    return Promise.all([this.points_, this.tools_.measures.known]);
  }

  /** The point in the middle of the view. Saves wait for the edit that asks for it. */
  private point_ahead(): ReturnType<PageParts['navigation']['point_ahead']> {
    const point = this.tools_.navigation.point_ahead();
    const known = point.catch(() => undefined);
    this.points_ = this.points_.then(() => known);
    return point;
  }

  private async add(): Promise<void> {
    const { eye } = this.tools_.navigation;
    const section = this.tools_.section();
    const { edited } = this.draft_.state;
    const { scene_id_: scene_id } = this;
    const marker = await this.point_ahead();
    // The author may have gone on to another tour, or to another scene.
    if (edited !== this.draft_.state.edited || scene_id !== this.scene_id_) return;
    const title = text.tour.stop_numbered({ n: this.draft_.stops.length + 1 });
    this.draft_.add({
      title,
      caption: '',
      ...untranslated,
      eye,
      section,
      marker,
      stay_s: undefined,
      fly_s: undefined,
      portal: undefined,
    });
    this.edited(this.draft_.stops.length - 1);
    const added = by_id('author-stops', HTMLOListElement).lastElementChild;
    added?.scrollIntoView({ block: 'nearest' });
    added?.querySelector('input')?.select();
    this.say(marker ? '' : text.author.no_marker);
  }

  private async take_view(index: number): Promise<void> {
    const { eye } = this.tools_.navigation;
    const section = this.tools_.section();
    const stop = this.draft_.stops[index];
    const marker = await this.point_ahead();
    const at = this.draft_.stops.findIndex((other) => other === stop); // it may have moved meanwhile
    if (at < 0) return;
    this.draft_.change(at, { eye, section, marker });
    this.edited();
  }

  private async take_marker(index: number): Promise<void> {
    const stop = this.draft_.stops[index];
    const marker = await this.point_ahead();
    const at = this.draft_.stops.findIndex((other) => other === stop);
    if (at < 0) return;
    if (marker) this.draft_.change(at, { marker });
    this.edited();
    if (!marker) this.say(text.author.nothing_there);
  }

  private remove(index: number): void {
    this.draft_.remove(index);
    this.edited(index);
    if (this.draft_.stops.length === 0) by_id('author-add', HTMLButtonElement).focus();
  }

  /** Undefined: there is no scene, or a description is missing, and the author is led to its field. */
  private sidecar(): string | undefined {
    if (this.asks_description()) return undefined;
    const { camera, own_up } = this.tools_.navigation;
    const { scene } = camera;
    return scene && `${JSON.stringify(this.draft_.sidecar(scene, own_up), undefined, 2)}\n`;
  }

  private asks_description(): boolean {
    const { undescribed } = this.draft_;
    if (!undescribed) return false;
    const { tour, stop, medium } = undescribed;
    if (tour !== this.draft_.state.edited) this.draft_.choose(tour);
    this.language_.choose_all();
    this.edited(stop);
    const { src } = this.draft_.stops[stop]!.media![medium]!;
    this.stops_.demand(`alt ${medium}`, text.author.not_described({ n: stop + 1, picture: src }));
    return true;
  }

  private async save(made_from: SidecarTag): Promise<void> {
    const sidecar = this.save_.disabled ? undefined : this.sidecar(); // saving already
    if (sidecar === undefined || this.token_ === undefined) return;
    const { state } = this.draft_;
    const focused = document.activeElement;
    this.save_.disabled = this.replace_.disabled = true;
    this.say(text.author.saving, this.done_);
    const result = await save_sidecar(
      location.href,
      this.token_,
      this.tools_.navigation.scene_id,
      sidecar,
      made_from,
    );
    this.save_.disabled = this.replace_.disabled = false;
    if (result.kind === 'saved') {
      this.saved_ = state;
      this.made_from_ = result.tag;
      this.replace_.hidden = true;
      this.say(text.author.saved, this.done_);
    } else if (result.kind === 'changed') {
      this.theirs_ = result.tag;
      this.replace_.hidden = false;
      this.say(text.author.changed_meanwhile, this.done_);
    } else this.say(text.author.not_saved(result), this.done_);
    // A button that is disabled loses the focus.
    if (focused === this.save_ || focused === this.replace_) this.save_.focus();
  }

  private download(): void {
    const sidecar = this.sidecar();
    if (sidecar === undefined) return;
    const name = `${file_name_of(this.tools_.navigation.scene_id)}.json`;
    save_file(new Blob([sidecar], { type: 'application/json' }), name);
    this.saved_ = this.draft_.state;
    this.say(
      this.token_ === undefined
        ? text.author.downloaded({ name })
        : text.author.downloaded_too({ name }),
      this.done_,
    );
  }

  private say(what: string, where = this.said_): void {
    this.said_.textContent = this.done_.textContent = '';
    where.textContent = what;
    where.scrollIntoView({ block: 'nearest' }); // an empty output is not displayed: nothing scrolls
  }

  /** The measures have changed, which are edited in a panel of their own. */
  private measured(field: string | undefined): void {
    const { own: measures } = this.tools_.measures;
    const { navigation } = this.tools_;
    if (measures === this.draft_.state.measures || navigation.scene_id !== this.scene_id_) return;
    this.draft_.edit({ measures }, field);
    this.say('');
    this.show_what_can_be_done();
  }

  private edited(open_stop?: number): void {
    this.told();
    this.show(open_stop);
  }

  private told(): void {
    this.say('');
    this.show_what_can_be_done();
    const { shown, shown_index, state } = this.draft_;
    if (state.start !== this.start_) this.tools_.start_at(state.start);
    this.start_ = state.start;
    const { value: language } = this.language_;
    this.tools_.measures.edit_language(language);
    this.tools_.measures.set_scale(state.about.metres_per_unit || undefined);
    if (state.measures !== this.tools_.measures.own) this.tools_.measures.load(state.measures);
    this.tools_.changed(tours_for(shown, language ? [language] : []), shown_index);
  }

  /** Typing in one language is one edit. */
  private typed_in(field: string | undefined): string | undefined {
    return field && `${field} ${this.language_.value}`;
  }

  private show(open_stop?: number): void {
    const { tour, editable, state } = this.draft_;
    const words = text.tour;
    this.tour_.replaceChildren(
      ...editable.map(
        (i, n) => new Option(state.tours[i]!.title || words.numbered({ n: n + 1 }), String(i)),
      ),
    );
    this.tour_.value = String(state.edited);
    const { value: language } = this.language_;
    this.title_.value = words_for(tour, language).title;
    this.title_.placeholder = language ? tour.title : text.author.tour_title;
    this.title_.lang = language;
    this.autoplay_.checked = tour.starts_itself;
    this.about_.show(state.about, language);
    this.stops_.show(tour.stops, language, open_stop);
    const change = (sound: Partial<Tour>, field?: string): void => {
      this.draft_.edit_tour(sound, field);
      if (field === undefined) this.edited();
      else this.told();
    };
    const sound = by_id('author-sound', HTMLElement);
    const has_focus = sound.contains(document.activeElement);
    sound.replaceChildren(this.tools_.media.of_tour(tour, language, change));
    if (has_focus) sound.querySelector<HTMLElement>('[data-control="sound"]')?.focus();
    this.show_what_can_be_done();
  }

  private show_what_can_be_done(): void {
    const { stops, editable, state, can_undo } = this.draft_;
    by_id('author-hint', HTMLElement).hidden = stops.length > 0;
    by_id('author-preview', HTMLButtonElement).disabled = stops.length === 0;
    by_id('author-undo', HTMLButtonElement).disabled = !can_undo;
    this.tour_.hidden = by_id('author-delete', HTMLButtonElement).hidden = editable.length < 2;
    by_id('author-new', HTMLButtonElement).hidden =
      stops.length === 0 || state.tours.length >= max_tours;
  }
}
