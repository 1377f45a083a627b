/** The text that a key such as "page.view" names. Throws where there is none. */
export function text_called(texts: object, key: string): string {
  const found = key
    .split('.')
    .reduce<unknown>((part, name) => (part as Record<string, unknown> | undefined)?.[name], texts);
  if (typeof found !== 'string') throw new Error(`no text is called ${key}`);
  return found;
}
