// Writes the English catalogues as literals, so that the compiler knows each text and the values in it.
import { mkdirSync, readFileSync, writeFileSync } from 'node:fs';

const folder = new URL('src/text/generated/', import.meta.url);
mkdirSync(folder, { recursive: true });
for (const name of ['en', 'operator', 'console']) {
  const json = readFileSync(new URL(`locales/${name}.json`, import.meta.url), 'utf8').trim();
  writeFileSync(new URL(`${name}.ts`, folder), `export const catalogue = ${json} as const;\n`);
}
