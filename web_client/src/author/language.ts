import { by_id } from '../page/dom';
import { languages } from '../text/language';
import { locale, text } from '../text/text';
import type { SceneAbout } from '../tour/draft';
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

  /** Offers the languages of the page, and those that the tours and the scene have besides. */
  offer(tours: readonly Tour[], about: SceneAbout): void {
    const items = tours.flatMap((tour) => [
      tour,
      tour.sound,
      ...tour.stops.flatMap((stop) => [stop, stop.narration, ...(stop.media ?? [])]),
    ]);
    const used = [about, ...items].flatMap((item) => [...(item?.translations.keys() ?? [])]);
    const tags = new Set<string>([...languages, ...used]);
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
