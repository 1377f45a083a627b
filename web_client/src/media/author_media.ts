// The author's fields for pictures, films, voices and sounds.
import type { MediaFields } from '../author/stops';
import { by_id, make } from '../page/dom';
import { text } from '../text/text';
import { texts_for, texts_written } from '../text/translations';
import { max_media, max_text_characters } from '../tour/limits';
import {
  accepted,
  kind_of,
  media_kinds,
  usual_volume,
  type MediaKind,
  type Medium,
  type Narration,
} from '../tour/media';
import type { Stop, Tour } from '../tour/tour';
import { MediaFolder } from './media_folder';

interface Choice {
  readonly label: string;
  readonly control: string; // by which the focus finds it again (author/stops.ts)
  readonly kinds: readonly (MediaKind | 'captions')[];
  /** The file that is chosen; '': none. */
  readonly value: string;
  readonly none: string; // how the choice of none is called
  readonly chosen: (name: string) => void;
}

/** A file on its way. Its elements move along when the fields are built anew, and so does what it is for. */
interface Upload {
  readonly field: readonly unknown[];
  readonly parts: readonly [HTMLButtonElement, HTMLInputElement, HTMLOutputElement];
  chosen: Choice['chosen'];
}

// All texts and files that one language may have of its own.
const no_voice = { src: '', captions: '' };
const no_sound = { src: '' };
const no_medium_texts = { alt: '', captions: '' };

type SetMedium = (i: number, change: (medium: Medium) => Partial<Medium>, field?: string) => void;

export class AuthorMedia implements MediaFields {
  private folder_: MediaFolder | undefined;
  private readonly open_ = new Set<string>(); // summaries whose fields are shown
  private looked_: Promise<void> | undefined; // what is there is known
  private owner_: readonly unknown[] = []; // of the fields that are built: a camera and a language
  private uploads_: readonly Upload[] = [];

  use(scene_id: string, token: string | undefined): void {
    this.folder_ = token === undefined ? undefined : new MediaFolder(scene_id, token);
    this.looked_ = this.folder_?.look();
  }

  of_stop(
    stop: () => Stop,
    n: string,
    language: string,
    change: (change: Partial<Stop>, field?: string) => void,
  ): HTMLElement {
    this.owner_ = ['stop', stop().eye, language];
    const media = stop().media ?? [];
    const words = text.media;
    // Typing in one field rebuilds no other, so what is there now is asked for.
    const set: SetMedium = (i, changed, field) =>
      change(
        {
          media: (stop().media ?? []).map((medium, j) =>
            j === i ? { ...medium, ...changed(medium) } : medium,
          ),
        },
        field,
      );
    const without = (i: number): Partial<Stop> => ({
      media: (stop().media ?? []).filter((_, j) => j !== i),
    });
    const rows = media.map((medium, i) =>
      this.row_of(medium, i, language, set, () => change(without(i))),
    );
    const add = this.choice({
      label: words.add,
      control: 'medium',
      kinds: media_kinds,
      value: '',
      none: words.choose,
      chosen: (src) => {
        const kind = kind_of(src);
        if (kind === undefined || kind === 'captions') return;
        change({
          media: [
            ...(stop().media ?? []),
            { src, kind, alt: '', translations: new Map(), language: '', captions: '' },
          ],
        });
      },
    });
    const voice = this.voice_of(stop().narration, language, change);
    const parts = [...rows, ...(media.length < max_media ? [add] : []), ...voice];
    const count = media.length + (stop().narration ? 1 : 0);
    return this.details(
      `stop ${n}`,
      count > 0 ? words.of_stop_count({ count }) : words.of_stop,
      parts,
    );
  }

  private voice_of(
    narration: Narration | undefined,
    language: string,
    change: (change: Partial<Stop>) => void,
  ): HTMLElement[] {
    const words = text.media;
    const spoken = narration && texts_for(narration, language, no_voice);
    const set_voice = (change_of_voice: Partial<typeof no_voice>): void => {
      if (!narration) return;
      const written = texts_written(narration, language, change_of_voice, no_voice);
      change({ narration: { ...narration, ...written } });
    };
    const voice = this.choice({
      label: words.narration,
      control: 'voice',
      kinds: ['audio'],
      value: spoken?.src ?? '',
      none: (language && narration?.src) || words.none,
      chosen: (src) => {
        if (narration && (src || language)) set_voice({ src });
        else
          change({ narration: src ? { src, captions: '', translations: new Map() } : undefined });
      },
    });
    if (!narration || !spoken) return [voice];
    const inherited = language && narration.captions;
    return [
      voice,
      this.captions_of(spoken.captions, narration.src, inherited, (captions) =>
        set_voice({ captions }),
      ),
    ];
  }

  of_tour(
    tour: Tour,
    language: string,
    change: (change: Partial<Tour>, field?: string) => void,
  ): HTMLElement {
    this.owner_ = ['tour', tour.stops[0]?.eye, language];
    const words = text.media;
    const { sound } = tour;
    const choice = this.choice({
      label: words.sound,
      control: 'sound',
      kinds: ['audio'],
      value: sound ? texts_for(sound, language, no_sound).src : '',
      none: (language && sound?.src) || words.none,
      chosen: (src) => {
        if (sound && (src || language))
          change({ sound: { ...sound, ...texts_written(sound, language, { src }, no_sound) } });
        else
          change({
            sound: src ? { src, volume: usual_volume, translations: new Map() } : undefined,
          });
      },
    });
    if (!sound) return choice;
    const volume = make('input', {
      type: 'range',
      min: '0.05',
      max: '1',
      step: '0.05',
      value: String(sound.volume),
    });
    volume.addEventListener('input', () =>
      change({ sound: { ...sound, volume: Number(volume.value) } }, 'volume'),
    );
    return make(
      'div',
      { className: 'media-fields' },
      choice,
      make('label', {}, words.volume, volume),
    );
  }

  private row_of(
    medium: Medium,
    i: number,
    language: string,
    set: SetMedium,
    remove: () => void,
  ): HTMLElement {
    const label = text.media.remove({ name: medium.src });
    const button = make(
      'button',
      { type: 'button', 'aria-label': label, title: label, onclick: remove },
      '×',
    );
    const name = make(
      'div',
      { className: 'medium' },
      make('span', { dir: 'ltr' }, medium.src),
      button,
    );
    const row = make('section', {}, name, this.alt_of(medium, i, language, set));
    const set_captions = (captions: string): void =>
      set(i, (now) => texts_written(now, language, { captions }, no_medium_texts));
    if (medium.kind !== 'image') {
      const { captions } = texts_for(medium, language, no_medium_texts);
      const inherited = language && medium.captions;
      row.append(this.captions_of(captions, medium.src, inherited, set_captions));
    }
    return row;
  }

  private alt_of(medium: Medium, i: number, language: string, set: SetMedium): HTMLElement {
    const own = language === '';
    const alt = make('input', {
      value: texts_for(medium, language, no_medium_texts).alt,
      maxLength: max_text_characters,
      dir: 'auto',
      lang: language,
      placeholder: own ? text.media.alt_hint : medium.alt,
      required: own && medium.kind === 'image',
      'aria-label': text.media.alt({ name: medium.src }),
    });
    alt.dataset['control'] = `alt ${i}`;
    alt.addEventListener('input', () => {
      alt.setCustomValidity(''); // what the author was told (AuthorStops.demand)
      const change = (now: Medium): Partial<Medium> =>
        texts_written(now, language, { alt: alt.value }, no_medium_texts);
      set(i, change, `alt ${medium.src}`);
    });
    return alt;
  }

  /** `inherited`: the file where none is chosen; '': none. */
  private captions_of(
    value: string,
    src: string,
    inherited: string,
    chosen: (name: string) => void,
  ): HTMLElement {
    return this.choice({
      label: text.media.captions_of({ name: src }),
      control: `captions ${src}`,
      kinds: ['captions'],
      value,
      none: inherited || text.media.none,
      chosen,
    });
  }

  private details(key: string, title: string, parts: HTMLElement[]): HTMLElement {
    const details = make(
      'details',
      { className: 'media-fields', open: this.open_.has(key) },
      make('summary', {}, title),
      ...parts,
    );
    details.addEventListener('toggle', () => {
      if (details.open) this.open_.add(key);
      else this.open_.delete(key);
    });
    return details;
  }

  /** A choice among the files that are there, and a button that sends another one. */
  private choice({ label, control, kinds, value, none, chosen }: Choice): HTMLElement {
    const words = text.media;
    const select = make('select', { 'aria-label': label });
    select.dataset['control'] = control;
    const fill = (): void => {
      const names = this.folder_?.of_kind(kinds) ?? [];
      const all = value && !names.includes(value) ? [value, ...names] : names; // the author wrote it by hand
      select.replaceChildren(new Option(none, ''), ...all.map((name) => new Option(name, name)));
      select.value = value;
    };
    fill();
    void this.looked_?.then(fill);
    select.addEventListener('focus', fill); // others may have been sent meanwhile
    select.addEventListener('change', () => chosen(select.value));
    const row = (...parts: HTMLElement[]): HTMLElement =>
      make('div', { className: 'media-choice' }, make('span', {}, label), select, ...parts);
    const field = [...this.owner_, control, this.folder_];
    const upload = this.uploads_.find((other) => other.field.every((part, i) => part === field[i]));
    if (upload) {
      upload.chosen = chosen;
      return row(...upload.parts);
    }
    const said = make('output', { 'aria-live': 'polite' });
    const file = make('input', {
      type: 'file',
      accept: accepted(kinds),
      hidden: true,
      'aria-label': words.upload_for({ label }),
    });
    const button = make(
      'button',
      { type: 'button', 'aria-label': words.upload_for({ label }) },
      words.upload,
    );
    const own: Upload = { field, parts: [button, file, said], chosen };
    button.addEventListener('click', () => file.click());
    file.addEventListener('change', () => {
      const [sent] = file.files ?? [];
      if (sent) void this.send(sent, own);
      file.value = '';
    });
    const { folder_: folder } = this;
    button.disabled = folder === undefined;
    if (folder === undefined) button.title = words.cannot_send;
    return row(...own.parts);
  }

  private async send(file: File, upload: Upload): Promise<void> {
    const { folder_: folder } = this;
    if (!folder) return;
    const [button, , said] = upload.parts;
    button.disabled = true;
    this.uploads_ = [...this.uploads_, upload];
    const end = (): void => {
      this.uploads_ = this.uploads_.filter((other) => other !== upload);
      button.disabled = false;
    };
    try {
      const name = await folder.add(file, (words) => (said.textContent = words));
      said.textContent = '';
      end();
      if (button.isConnected) upload.chosen(name);
      else by_id('author-said', HTMLOutputElement).textContent = text.media.sent({ name });
    } catch (error) {
      said.textContent = error instanceof Error ? error.message : String(error);
      end();
    }
  }
}
