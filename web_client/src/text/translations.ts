// Texts that authors wrote in several languages. Pure.
import { primary } from './language';

/** By BCP 47 tag. A text that is empty there comes from the item itself. */
export type Translations<Texts> = ReadonlyMap<string, Texts>;

interface HasTranslations<Texts> {
  readonly translations: Translations<Texts>;
}
type Translated<Texts> = Readonly<Partial<Texts>> & HasTranslations<Texts>;

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

const said = (texts: object): [name: string, text: unknown][] =>
  Object.entries(texts).filter(([, written]) => written !== '');

/** The same in the first language of `readers` that it has a translation for, and the tag of that language. */
export function in_language<T extends HasTranslations<object>>(
  item: T,
  readers: readonly string[],
): T & { readonly language?: string } {
  const language = tag_for([...item.translations.keys()], readers);
  if (language === undefined) return item;
  return { ...item, ...Object.fromEntries(said(item.translations.get(language)!)), language };
}

/** What an author has written for this language; '' for what all others get. `none`: all texts, empty. */
export function texts_for<Texts extends object>(
  item: Translated<Texts>,
  language: string,
  none: Texts,
): Texts {
  if (language !== '') return { ...none, ...item.translations.get(language) };
  const own = Object.keys(none).map((name) => [name, item[name as keyof Texts] ?? '']);
  return Object.fromEntries(own) as Texts;
}

/** The translations of `item` with these texts in one language. */
export const translated = <Texts extends object>(
  item: Translated<Texts>,
  language: string,
  texts: Partial<Texts>,
  none: Texts,
): HasTranslations<Texts> => ({
  translations: new Map([
    ...item.translations,
    [language, { ...texts_for(item, language, none), ...texts }],
  ]),
});

/** The change of `item` that writes these texts for one language, or for all others. */
export const texts_written = <Texts extends object>(
  item: Translated<Texts>,
  language: string,
  texts: Partial<Texts>,
  none: Texts,
): Partial<Texts> | HasTranslations<Texts> =>
  language === '' ? texts : translated(item, language, texts, none);

/** As sidecars have them, without what is empty. */
export function write_translations(translations: Translations<object>): object {
  const written = [...translations]
    .map(([tag, texts]) => [tag, said(texts)] as const)
    .filter(([, texts]) => texts.length > 0)
    .map(([tag, texts]) => [tag, Object.fromEntries(texts)] as const);
  return written.length > 0 ? { translations: Object.fromEntries(written) } : {};
}
