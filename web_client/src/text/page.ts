// Puts the visitor's language into the page. The build has put English there, and beside each text the key
// of it (page_texts.ts).
import { text_called } from './key';
import { is_right_to_left } from './language';
import { language, text } from './text';

/** Attributes of index.html that hold texts. The key of `title` is in `data-title`. */
const worded_attributes = ['aria-label', 'title', 'placeholder'] as const;

export function translate_page(): void {
  const { documentElement: page } = document;
  page.lang = language;
  page.dir = is_right_to_left(language) ? 'rtl' : 'ltr';
  if (language === 'en') return;
  for (const element of document.querySelectorAll('[data-text]')) {
    element.textContent = text_called(text, element.getAttribute('data-text') ?? '');
  }
  for (const attribute of worded_attributes) {
    for (const element of document.querySelectorAll(`[data-${attribute}]`)) {
      element.setAttribute(
        attribute,
        text_called(text, element.getAttribute(`data-${attribute}`) ?? ''),
      );
    }
  }
}
