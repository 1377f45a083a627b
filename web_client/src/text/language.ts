// Which language the page speaks. Pure.

/** Each has a file of its own here. */
export const languages = ['en', 'de', 'fr', 'es', 'it', 'ja', 'zh-Hans', 'ko', 'ar'] as const;
export type Language = (typeof languages)[number];

export interface LanguageChoice {
  /** Of the page's own texts. */
  readonly language: Language;
  /** BCP 47 tag for numbers and units. It may name a region, too. */
  readonly locale: string;
  /** What the visitor reads, best first. Texts of tours may come in languages that the page does not speak. */
  readonly readers: readonly string[];
}

const english: LanguageChoice = { language: 'en', locale: 'en', readers: ['en'] };

/** "zh" of "zh-CN". */
export const primary = (tag: string): string => tag.toLowerCase().split('-', 1)[0]!;

/** Takes `?lang=` of the address, then the browser's list. English where the page speaks none of them. */
export function choose_language(page_url: string, preferred: readonly string[]): LanguageChoice {
  const requested = new URL(page_url).searchParams.get('lang');
  const tags = [...(requested === null ? [] : [requested]), ...preferred].filter(is_tag);
  for (const locale of tags) {
    const language = languages.find((known) => primary(known) === primary(locale));
    if (language) return { language, locale, readers: [tags[0]!, language] };
  }
  return { ...english, readers: [...tags.slice(0, 1), ...english.readers] };
}

export const is_right_to_left = (language: Language): boolean => language === 'ar';

/** Whether Intl takes it; it throws at anything else. */
function is_tag(text: string): boolean {
  try {
    return Intl.getCanonicalLocales(text).length === 1;
  } catch {
    return false;
  }
}
