// Titles and captions of tours, in the languages that their authors wrote. Pure.
import { primary } from '../text/language';

interface Words {
  readonly title: string;
  readonly caption: string; // tours have none
}

/** What a visitor reads of a tour or a stop. */
export interface Worded extends Partial<Words> {
  readonly title: string;
  /** By BCP 47 tag. A word that is empty there comes from the fields above. */
  readonly translations: ReadonlyMap<string, Words>;
  /** Tag of the fields above; '': its author did not say. */
  readonly language: string;
}

/** Of a tour or a stop in one language that nobody named. */
export const untranslated: Pick<Worded, 'translations' | 'language'> = {
  translations: new Map(),
  language: '',
};

/** The tag for the first of `readers` that has one; undefined: none has. */
export function tag_for(tags: readonly string[], readers: readonly string[]): string | undefined {
  for (const reader of readers) {
    const found =
      tags.find((tag) => tag.toLowerCase() === reader.toLowerCase()) ??
      tags.find((tag) => primary(tag) === primary(reader));
    if (found !== undefined) return found;
  }
  return undefined;
}

/** The same in the first language of `readers` that it has a translation for. */
export function in_language<T extends Worded>(item: T, readers: readonly string[]): T {
  const language = tag_for([...item.translations.keys()], readers);
  if (language === undefined) return item;
  const { title, caption } = item.translations.get(language)!;
  return { ...item, language, ...(title && { title }), ...(caption && { caption }) };
}

/** What an author has written for this language; '' for the words that all others get. */
export function words_for({ title, caption = '', translations }: Worded, language: string): Words {
  if (language === '') return { title, caption };
  return translations.get(language) ?? { title: '', caption: '' };
}

/** The change of a tour or a stop that writes these words for one language. */
export function worded<C extends Partial<Worded>>(
  item: Worded,
  language: string,
  change: C,
): C | (Omit<C, keyof Words> & Pick<Worded, 'translations'>) {
  const { title, caption, ...other } = change;
  if (language === '' || (title === undefined && caption === undefined)) return change;
  const before = words_for(item, language);
  const words = { title: title ?? before.title, caption: caption ?? before.caption };
  return { ...other, translations: new Map([...item.translations, [language, words]]) };
}
