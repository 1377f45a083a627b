// What stops show and play besides words: pictures, films and sounds. Pure.
import { text } from '../text/text';
import { write_translations, type Translations } from '../text/translations';
import type { JsonField } from './json_field';
import { max_media } from './limits';
import { read_translations } from './words';

export const media_kinds = ['image', 'video', 'audio'] as const;
export type MediaKind = (typeof media_kinds)[number];

interface MediumTexts {
  readonly alt: string;
  readonly captions: string;
}

/** A picture, film or sound that a stop shows. */
export interface Medium {
  /** Name of a file in the scene's media folder, or an https address. */
  readonly src: string;
  readonly kind: MediaKind;
  /** What it shows, for those who do not see it. Pictures always have one. */
  readonly alt: string;
  readonly translations: Translations<MediumTexts>;
  /** Tag of `alt`; '': its author did not say. */
  readonly language: string;
  /** Name of a .vtt file; '': none. */
  readonly captions: string;
}

/** A voice that is heard when a visitor comes to a stop. */
export interface Narration {
  readonly src: string;
  readonly captions: string;
  readonly translations: Translations<Omit<Narration, 'translations'>>;
}

/** What is heard during a tour. `volume`: 0…1. */
export interface TourSound {
  readonly src: string;
  readonly volume: number;
  readonly translations: Translations<Pick<TourSound, 'src'>>;
}

export const usual_volume = 0.5;

// server/media/media_type.cpp knows the same extensions; tests/web_client/media.test.ts compares them.
const extensions: Readonly<Record<MediaKind | 'captions', readonly string[]>> = {
  image: ['jpg', 'jpeg', 'png', 'webp'],
  video: ['mp4', 'webm'],
  audio: ['mp3', 'm4a', 'ogg', 'wav'],
  captions: ['vtt'],
};

/** What the extension of a name or an address promises; undefined: nothing that is known. */
export function kind_of(src: string): MediaKind | 'captions' | undefined {
  const extension = /\.(\w+)(?:[?#].*)?$/.exec(src)?.[1]?.toLowerCase() ?? '';
  return ([...media_kinds, 'captions'] as const).find((kind) =>
    extensions[kind].includes(extension),
  );
}

/** For file choosers: ".jpg,.jpeg,…". */
export const accepted = (kinds: readonly (MediaKind | 'captions')[]): string =>
  kinds.flatMap((kind) => extensions[kind].map((extension) => `.${extension}`)).join(',');

/** Whether a source lies on another server. */
export const is_foreign = (src: string): boolean => src.startsWith('https://');

const { mistakes } = text.media;

/** Reads `src`, and `type` where the extension does not tell the kind. */
function read_source(field: JsonField): { src: string; kind: MediaKind } {
  const source = field.at('src');
  const src = source.text();
  if (!is_foreign(src) && !/^[\w-][\w.-]{0,99}$/.test(src)) source.fail(mistakes.no_media_name);
  const written = field.find('type');
  const kind =
    written === undefined ? kind_of(src) : media_kinds.find((name) => name === written.text());
  if (kind !== undefined && kind !== 'captions') return { src, kind };
  return (written ?? source).fail(mistakes.no_media_kind);
}

function read_captions(field: JsonField): string {
  const captions = field.find('captions');
  const name = captions?.text() ?? '';
  if (captions && (is_foreign(name) || kind_of(name) !== 'captions'))
    captions.fail(mistakes.no_captions);
  return name;
}

export const read_media = (media: JsonField | undefined): readonly Medium[] | undefined =>
  media?.elements(max_media).map((field) => {
    const { src, kind } = read_source(field);
    const alt = (kind === 'image' ? field.at('alt') : field.find('alt'))?.text() ?? '';
    const translations = read_translations(field, (texts) => ({
      alt: texts.find('alt')?.text() ?? '',
      captions: read_captions(texts),
    }));
    return { src, kind, alt, translations, language: '', captions: read_captions(field) };
  });

function read_sound(field: JsonField): string {
  const { src, kind } = read_source(field);
  if (kind !== 'audio') field.at('src').fail(mistakes.no_sound);
  return src;
}

/** In one language, where it may be missing. */
const read_other_sound = (field: JsonField): string => (field.find('src') ? read_sound(field) : '');

export const read_narration = (field: JsonField | undefined): Narration | undefined =>
  field && {
    src: read_sound(field),
    captions: read_captions(field),
    translations: read_translations(field, (spoken) => ({
      src: read_other_sound(spoken),
      captions: read_captions(spoken),
    })),
  };

export const read_tour_sound = (field: JsonField | undefined): TourSound | undefined =>
  field && {
    src: read_sound(field),
    volume: field.find('volume')?.number(0, 1) ?? usual_volume,
    translations: read_translations(field, (sound) => ({ src: read_other_sound(sound) })),
  };

const write_source = (src: string, kind: MediaKind): object => ({
  src,
  ...(kind_of(src) !== kind && { type: kind }),
});

/** Writes what read_media() reads. */
export const write_media = (media: readonly Medium[]): unknown[] =>
  media.map(({ src, kind, alt, captions, translations }) => ({
    ...write_source(src, kind),
    ...(alt && { alt }),
    ...(captions && { captions }),
    ...write_translations(translations),
  }));

const write_sounds = (sounds: Translations<Pick<TourSound, 'src'>>): object =>
  write_translations(
    new Map(
      [...sounds].map(([tag, sound]) => [
        tag,
        { ...sound, ...(sound.src && write_source(sound.src, 'audio')) },
      ]),
    ),
  );

export const write_narration = ({ src, captions, translations }: Narration): object => ({
  ...write_source(src, 'audio'),
  ...(captions && { captions }),
  ...write_sounds(translations),
});

export const write_tour_sound = ({ src, volume, translations }: TourSound): object => ({
  ...write_source(src, 'audio'),
  ...(volume !== usual_volume && { volume }),
  ...write_sounds(translations),
});
