// The texts of the page in the visitor's language. English is part of the page. Other languages load before
// the page starts, and a language that does not come is replaced by English.
import { text as english } from './en';
import { choose_language, type Language, type LanguageChoice } from './language';

/** The shape of `T`, with any texts in it. */
type InAnyLanguage<T> = T extends string
  ? string
  : T extends (...values: infer V) => string
    ? (...values: V) => string
    : { readonly [K in keyof T]: InAnyLanguage<T[K]> };
export type Texts = InAnyLanguage<typeof english>;

const files: Readonly<Record<Exclude<Language, 'en'>, () => Promise<{ text: Texts }>>> = {
  de: () => import('./de'),
  fr: () => import('./fr'),
  es: () => import('./es'),
  it: () => import('./it'),
  ja: () => import('./ja'),
  'zh-Hans': () => import('./zh-Hans'),
  ko: () => import('./ko'),
  ar: () => import('./ar'),
};

export async function load_texts(language: Language): Promise<Texts> {
  return language === 'en' ? english : (await files[language]()).text;
}

const in_english = choose_language('catgs:', []);

async function load(choice: LanguageChoice): Promise<LanguageChoice & { readonly text: Texts }> {
  try {
    return { ...choice, text: await load_texts(choice.language) };
  } catch (error) {
    console.warn('the texts could not be loaded', error); // the server is away
    return { ...in_english, text: english };
  }
}

// Neither tests nor workers have a document; they get English.
const has_page = 'document' in globalThis;

export const { text, language, locale, readers } = await load(
  has_page ? choose_language(location.href, navigator.languages) : in_english,
);
