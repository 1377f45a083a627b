// Writes the English texts as literals, so that the compiler knows each text and the values in it.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';

const folder = new URL('src/text/generated/', import.meta.url);
const literal = (name) => {
  const json = readFileSync(new URL(`locales/${name}.json`, import.meta.url), 'utf8').trim();
  return `${json} as const;`;
};

mkdirSync(folder, { recursive: true });
writeFileSync(
  new URL('english.ts', folder),
  `export const english = ${literal('en')}\nexport const english_operator = ${literal('operator')}\n`,
);
