// Puts the texts of locales/en.json into index.html, where {{page.view}} names one, and leaves the key beside
// each, for other languages (src/text/page.ts). The build does this, so that the texts are readable without a
// script and an English page does not change while it loads.
import { catalogue } from './src/text/generated/en';
import { text_called } from './src/text/key';
import { messages } from './src/text/messages';

const text = messages(catalogue, 'en', 'en');

const escaped = (plain: string): string => plain.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

const escaped_text = (key: string): string => escaped(text_called(text, key));

/** Throws where a text is neither an attribute nor all that its element holds. */
export function with_texts(html: string): string {
  const done = html
    .replace(
      / ([\w-]+)="\{\{([\w.]+)\}\}"/g,
      (_, name: string, key: string) => ` ${name}="${escaped_text(key)}" data-${name}="${key}"`,
    )
    .replace(
      />\{\{([\w.]+)\}\}<\//g,
      (_, key: string) => ` data-text="${key}">${escaped_text(key)}</`,
    );
  const left = /[^>]*\{\{[^}]*\}\}/.exec(done);
  if (left) throw new Error(`index.html: ${left[0].trim()} is not the whole text of an element`);
  return done;
}
