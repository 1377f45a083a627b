// Titles and captions of tours, in the languages that their authors wrote. Pure.
import { texts_for, translated, type Translations } from '../text/translations';
import type { JsonField } from './json_field';
import { max_languages } from './limits';

interface Words {
  readonly title: string;
  readonly caption: string; // tours have none
}

/** What a visitor reads of a tour or a stop. */
export interface Worded extends Partial<Words> {
  readonly title: string;
  readonly translations: Translations<Words>;
  /** Tag of the fields above; '': its author did not say. */
  readonly language: string;
}

/** Of a tour or a stop in one language that nobody named. */
export const untranslated: Pick<Worded, 'translations' | 'language'> = {
  translations: new Map(),
  language: '',
};

const no_words: Words = { title: '', caption: '' };

/** What an author has written for this language; '' for the words that all others get. */
export const words_for = (item: Worded, language: string): Words =>
  texts_for(item, language, no_words);

/** The change of a tour or a stop that writes these words for one language. */
export function worded<C extends Partial<Worded>>(
  item: Worded,
  language: string,
  change: C,
): C | (Omit<C, keyof Words> & Pick<Worded, 'translations'>) {
  const { title, caption, ...other } = change;
  if (language === '' || (title === undefined && caption === undefined)) return change;
  const words = {
    ...(title !== undefined && { title }),
    ...(caption !== undefined && { caption }),
  };
  return { ...other, ...translated(item, language, words, no_words) };
}

/** `read`: the texts in one language. */
export const read_translations = <Texts>(
  item: JsonField,
  read: (texts: JsonField) => Texts,
): Translations<Texts> =>
  new Map(
    (item.find('translations')?.members(max_languages) ?? []).map(([tag, texts]) => [
      tag,
      read(texts),
    ]),
  );
