// Puts the texts of src/text.ts into index.html, where {{page.view}} names one. The build does this, so
// that the texts are readable without a script and the page does not change while it loads.
import { text } from './src/text';

function text_called(key: string): string {
  const found = key
    .split('.')
    .reduce<unknown>((part, name) => (part as Record<string, unknown> | undefined)?.[name], text);
  if (typeof found !== 'string') throw new Error(`src/text.ts has no text ${key}`);
  return found;
}

const escaped = (plain: string): string =>
  plain.replace(/[&<>"]/g, (c) => `&#${c.charCodeAt(0)};`);

export const with_texts = (html: string): string =>
  html.replace(/\{\{([\w.]+)\}\}/g, (_, key: string) => escaped(text_called(key)));
