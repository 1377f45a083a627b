import { by_id } from '../page/dom';
import { languages } from '../text/language';
import { locale, text } from '../text/text';
import type { Tour } from '../tour/tour';

/** The choice for whom an author writes: all visitors, or those who read one language. */
export class AuthorLanguage {
  private readonly choice_ = by_id('author-language', HTMLSelectElement);
  private readonly names_ = new Intl.DisplayNames(locale, { type: 'language' });

  constructor(changed: () => void) {
    this.choice_.addEventListener('change', changed);
  }

  /** Tag of the language; '' for all visitors. */
  get value(): string {
    return this.choice_.value;
  }

  choose_all(): void {
    this.choice_.value = '';
  }

  /** Offers the languages of the page, and those that these tours have besides. */
  offer(tours: readonly Tour[]): void {
    const used = tours.flatMap(({ translations, stops }) => [
      translations,
      ...stops.map((stop) => stop.translations),
    ]);
    const tags = new Set<string>([...languages, ...used.flatMap((words) => [...words.keys()])]);
    const chosen = this.choice_.value;
    this.choice_.replaceChildren(
      new Option(text.author.all_visitors, ''),
      ...[...tags].map((tag) => new Option(this.name_of(tag), tag)),
    );
    this.choice_.value = tags.has(chosen) ? chosen : '';
  }

  private name_of(tag: string): string {
    try {
      return this.names_.of(tag) ?? tag;
    } catch {
      return tag; // people write anything
    }
  }
}
