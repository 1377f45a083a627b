// The texts of the page in the visitor's language. English is part of the page. Other languages load before
// the page starts, and a language that does not come is replaced by English.
import { catalogue as english } from './generated/en';
import { choose_language, type Language, type LanguageChoice } from './language';
import { messages, type Catalogue, type Messages } from './messages';

export type Texts = Messages<typeof english>;

type Load = () => Promise<{ default: Catalogue }>;

const translations: Readonly<Record<Exclude<Language, 'en'>, Load>> = {
  de: () => import('../../locales/de.json'),
  fr: () => import('../../locales/fr.json'),
  es: () => import('../../locales/es.json'),
  it: () => import('../../locales/it.json'),
  ja: () => import('../../locales/ja.json'),
  'zh-Hans': () => import('../../locales/zh-Hans.json'),
  ko: () => import('../../locales/ko.json'),
  ar: () => import('../../locales/ar.json'),
};

/** `locale`: in which numbers are written. */
export async function load_texts(language: Language, locale: string): Promise<Texts> {
  if (language === 'en') return messages(english, language, locale);
  // A test compares the keys and the values in the texts: they are those of English.
  const load = translations[language];
  const translation = (await load().catch(load)).default as typeof english;
  return messages(translation, language, locale);
}

const in_english = choose_language('catgs:', []);

async function load(choice: LanguageChoice): Promise<LanguageChoice & { readonly text: Texts }> {
  try {
    return { ...choice, text: await load_texts(choice.language, choice.locale) };
  } catch (error) {
    console.warn('the texts could not be loaded', error); // the server is away
    return { ...in_english, text: messages(english, in_english.language, in_english.locale) };
  }
}

// Neither tests nor workers have a document; they get English.
const has_page = 'document' in globalThis;

export const { text, language, locale, readers } = await load(
  has_page ? choose_language(location.href, navigator.languages) : in_english,
);
