// The languages of the page: which one a visitor gets, and whether each says all of it.
import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import ts from 'typescript';
import { describe, expect, it } from 'vitest';
import { choose_language, languages } from '#client/text/language';
import { messages, type Catalogue } from '#client/text/messages';
import { decimals, duration, factor, number, read_number } from '#client/text/number';
import { load_texts } from '#client/text/text';

const source = fileURLToPath(new URL('../../web_client/src', import.meta.url));
const locales = path.join(source, '../locales');

describe('the language of the page', () => {
  const of = (preferred: readonly string[], query = ''): string =>
    choose_language(`http://host/${query}`, preferred).language;

  it.each([
    [['de-CH', 'fr'], '', 'de'],
    [['nl', 'fr-CA', 'en'], '', 'fr'],
    [['EN-us'], '', 'en'],
    [['zh-TW'], '', 'zh-Hans'],
    [['nl', 'pt'], '', 'en'],
    [[], '', 'en'],
    [['de'], '?lang=ja', 'ja'],
    [['de'], '?scene=a&lang=zh', 'zh-Hans'],
    [['de'], '?lang=nl', 'de'],
    [['de'], '?lang=', 'de'],
    [['de_AT', '*', 'it'], '?lang=%00<b>', 'it'],
  ])('of %j and "%s" is %s', (preferred, query, language) => {
    expect(of(preferred, query)).toBe(language);
  });

  it('comes with the tag for numbers, and with what the visitor reads best', () => {
    expect(choose_language('http://host/', ['de-CH', 'en'])).toEqual({
      language: 'de',
      locale: 'de-CH',
      readers: ['de-CH', 'de'],
    });
    expect(choose_language('http://host/?lang=ar', ['nl']).locale).toBe('ar');
    // The page does not speak Dutch, but a tour may.
    expect(choose_language('http://host/', ['nl', 'ko'])).toMatchObject({
      language: 'ko',
      readers: ['nl', 'ko'],
    });
    expect(choose_language('http://host/', ['nl'])).toMatchObject({
      language: 'en',
      locale: 'en',
      readers: ['nl', 'en'],
    });
  });
});

/** Catalogues beside the languages. */
const english_only = ['operator', 'console'] as const;

const read_catalogue = (name: string): Catalogue =>
  JSON.parse(readFileSync(path.join(locales, `${name}.json`), 'utf8')) as Catalogue;

/** Every text with its key, as its forms: those of a plural by their category, else one without a category. */
function forms_of(
  catalogue: Catalogue,
  prefix = '',
): Map<string, Readonly<Record<string, string>>> {
  const found = new Map<string, Readonly<Record<string, string>>>();
  for (const [name, node] of Object.entries(catalogue)) {
    const key = prefix + name;
    if (typeof node === 'string') found.set(key, { '': node });
    else if (typeof node['other'] === 'string')
      found.set(key, node as Readonly<Record<string, string>>);
    else for (const [inner, forms] of forms_of(node, `${key}.`)) found.set(inner, forms);
  }
  return found;
}

const values_in = (words: string): string[] => words.match(/\{\w+\}/g) ?? [];
const all_values = (forms: Readonly<Record<string, string>>): string[] =>
  [...new Set(Object.values(forms).flatMap(values_in))].sort();

it('each language has a catalogue, and each catalogue a language', () => {
  const files = readdirSync(locales).sort();
  expect(files).toEqual([...languages, ...english_only].map((name) => `${name}.json`).sort());
});

describe.each([...languages, ...english_only])('the catalogue %s', (name) => {
  const is_english = english_only.some((other) => other === name);
  const language = is_english ? 'en' : name;
  const original = forms_of(read_catalogue(is_english ? name : 'en'));
  const translated = forms_of(read_catalogue(name));

  it('has the texts of English', () => {
    const missing = [...original.keys()].filter((key) => !translated.has(key));
    expect(missing).toEqual([]);
    expect([...translated.keys()]).toEqual([...original.keys()]);
    for (const [key, forms] of translated) {
      expect('other' in forms, key).toBe('other' in original.get(key)!);
      for (const words of Object.values(forms)) {
        expect(words.trim(), key).not.toBe('');
        expect(/^\s/.test(words), key).toBe(/^\s/.test(Object.values(original.get(key)!)[0]!));
      }
    }
  });

  it('has the values of English in them', () => {
    for (const [key, forms] of translated)
      expect(all_values(forms), key).toEqual(all_values(original.get(key)!));
  });

  it('has a plural form for every number, and no other', () => {
    const rules = new Intl.PluralRules(language);
    const { pluralCategories } = rules.resolvedOptions();
    for (const [key, forms] of translated) {
      if (!('other' in forms)) continue;
      for (let n = 0; n <= 200; ++n)
        expect(forms[`=${n}`] ?? forms[rules.select(n)], `${key}: ${n}`).toBeDefined();
      const categories = Object.keys(forms).filter((form) => !/^=\d+$/.test(form));
      expect(pluralCategories, key).toEqual(expect.arrayContaining(categories));
    }
  });

  it.skipIf(language === 'en')('is not English', () => {
    const same = [...translated].filter(([key, forms]) => {
      const english = Object.values(original.get(key)!);
      return Object.values(forms).some((words) => english.includes(words) && / \w+ /.test(words));
    });
    expect(same).toEqual([]);
  });
});

describe('messages', () => {
  it('have the values, with numbers as the locale writes them', () => {
    const { place, plain } = messages(
      { place: '{n} of {count}', plain: 'Stops' } as const,
      'en',
      'de',
    );
    expect([place({ n: 'one', count: 12345 }), plain]).toEqual(['one of 12.345', 'Stops']);
  });

  it('have the plural form of the count', async () => {
    const { tour } = await load_texts('ar', 'ar-u-nu-latn');
    const forms = [1, 2, 3, 11, 100].map((count) => tour.stops({ count }));
    expect(forms).toEqual(['محطة واحدة', 'محطتان', '3 محطات', '11 محطة', '100 محطة']);
    const { shared_tour } = await load_texts('en', 'en');
    expect([0, 1, 2].map((count) => shared_tour.you_present({ count }))).toEqual([
      'You are presenting. Nobody has joined yet.',
      'You are presenting to one participant.',
      'You are presenting to 2 participants.',
    ]);
  });

  it('are typed: the compiler knows each text and its values', async () => {
    const { tour } = await load_texts('en', 'en');
    // @ts-expect-error: there is no such text
    expect(tour.swim).toBeUndefined();
    // @ts-expect-error: `count` is missing
    expect(tour.position({ n: 1 })).toBe('1 of ');
  });
});

it('writes numbers and times', () => {
  expect(number(1234567)).toBe('1,234,567');
  expect(decimals(2, 1)).toBe('2.0');
  expect(factor(1.68179)).toBe('1.7×');
  expect([0.4, 1, 45, 89.4, 90, 600].map(duration)).toEqual([
    'a moment',
    '1 second',
    '45 seconds',
    '89 seconds',
    '2 minutes',
    '10 minutes',
  ]);
});

describe('texts for people', () => {
  /** Files of the client, without the languages and what is generated. */
  // charts/ is a page of operators, in English.
  const files = readdirSync(source, { recursive: true, encoding: 'utf8' })
    .filter(
      (file) =>
        file.endsWith('.ts') && !/^(text|charts)\/|generated/.test(file.replaceAll('\\', '/')),
    )
    .map((file) => path.join(source, file));

  /** Errors and warnings are for who looks into the console. Types, imports and selectors are not shown. */
  function is_for_machines(node: ts.Node): boolean {
    const { parent } = node;
    if (ts.isImportDeclaration(parent) || ts.isLiteralTypeNode(parent)) return true;
    for (let at: ts.Node = parent; !ts.isSourceFile(at); at = at.parent) {
      if (ts.isStatement(at)) return false;
      const called =
        ts.isCallExpression(at) || ts.isNewExpression(at) ? at.expression.getText() : '';
      if (
        /^console\.|^require$|Error$|querySelector|matchMedia|\.matches$|message\.startsWith$|\.undecodable$/.test(
          called,
        )
      )
        return true;
    }
    return false;
  }

  /** Two words, or one that begins a sentence. */
  const is_prose = (words: string): boolean =>
    /[a-z]{2,} [a-z]{2,}/i.test(words) || /^[A-Z][a-z]{2,}( |$)/.test(words);

  // Shaders, markup, and names that browsers give or that paper has.
  const not_prose =
    /^#version|^\s*<iframe|^\d+px |^double tap$|^(Key|Page|Arrow|Escape|Space|Tab|Shift|Numpad|Delete|Backspace)[A-Z]?[a-z]*$|^(Letter|OffscreenCanvas|WebSocket|Worker|Notification|Unidentified|Bearer |noopener noreferrer)$/;

  it('are in the files of the languages alone', () => {
    const loose: string[] = [];
    for (const file of files) {
      const tree = ts.createSourceFile(
        file,
        readFileSync(file, 'utf8'),
        ts.ScriptTarget.ES2022,
        true,
      );
      const look = (node: ts.Node): void => {
        const is_literal =
          ts.isStringLiteralLike(node) ||
          ts.isTemplateHead(node) ||
          ts.isTemplateMiddleOrTemplateTail(node);
        if (
          is_literal &&
          is_prose(node.text) &&
          !not_prose.test(node.text) &&
          !is_for_machines(node)
        ) {
          const { line } = tree.getLineAndCharacterOfPosition(node.getStart());
          loose.push(`${path.relative(source, file)}:${line + 1}: ${node.text.slice(0, 60)}`);
        }
        ts.forEachChild(node, look);
      };
      look(tree);
    }
    expect(files.length).toBeGreaterThan(60);
    expect(loose).toEqual([]);
  }, 60_000); // it parses the whole client
});

it.each([
  ['3,2', 3.2],
  ['3.2', 3.2],
  [' 3,20 ', 3.2],
  [',5', 0.5],
  ['7.', 7],
  ['-1,5', -1.5],
  ['−1.5', -1.5],
  ['٣٫٢', 3.2],
  ['３．２', 3.2],
  ['1.234,5', 1234.5],
  ['1,234.5', 1234.5],
  ["1'234.5", 1234.5],
  ['1\u202f234,5', 1234.5],
  ['1,234,567', 1234567],
  ['1,234', 1.234], // one comma alone begins the decimals
  ['', undefined],
  ['3,2,1', undefined],
  ['1.2,3.4', undefined],
  ['12,34.5', undefined],
  ['3.2 m', undefined],
  ['1e5', undefined],
  ['Infinity', undefined],
])('"%s" is a number in every language', (written, value) => {
  expect(read_number(written)).toBe(value);
});
