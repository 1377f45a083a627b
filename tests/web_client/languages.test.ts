// The languages of the page: which one a visitor gets, and whether each says all of it.
import { readdirSync, readFileSync } from 'node:fs';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import ts from 'typescript';
import { beforeAll, describe, expect, it } from 'vitest';
import { text as english } from '#client/text/en';
import { choose_language, languages } from '#client/text/language';
import { decimals, duration, factor, number } from '#client/text/number';
import { load_texts, type Texts } from '#client/text/text';

const source = fileURLToPath(new URL('../../web_client/src', import.meta.url));

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
      ...{ language: 'de', locale: 'de-CH', readers: ['de-CH', 'de'] },
    });
    expect(choose_language('http://host/?lang=ar', ['nl']).locale).toBe('ar');
    // The page does not speak Dutch, but a tour may.
    expect(choose_language('http://host/', ['nl', 'ko'])).toMatchObject({ language: 'ko', readers: ['nl', 'ko'] });
    expect(choose_language('http://host/', ['nl'])).toMatchObject({ language: 'en', locale: 'en', readers: ['nl', 'en'] });
  });
});

/** Every text with its key, and functions called with values that can be found again. */
function said(texts: object, prefix = ''): Map<string, string> {
  const found = new Map<string, string>();
  for (const [name, value] of Object.entries(texts) as [string, unknown][]) {
    const key = prefix + name;
    if (typeof value === 'string') found.set(key, value);
    else if (typeof value === 'function') {
      const make = value as (...values: unknown[]) => string;
      found.set(key, make('‹0›', '‹1›', '‹2›'));
      for (const count of [0, 1, 2, 3, 11, 100]) make('‹0›', count, '‹2›');
    } else for (const [inner, words] of said(value as object, `${key}.`)) found.set(inner, words);
  }
  return found;
}

const placeholders = (words: string): string[] => (words.match(/‹\d›/g) ?? []).sort();

describe.each(languages.filter((language) => language !== 'en'))('%s', (language) => {
  let texts: Map<string, string>;
  const originals = said(english);

  beforeAll(async () => {
    texts = said(await load_texts(language));
  });

  it('says all that English says, with the same values in it', () => {
    expect([...texts.keys()]).toEqual([...originals.keys()]);
    for (const [key, words] of texts) {
      expect(words.trim(), key).not.toBe('');
      // Where one or none is meant, a language may write a word and leave the number out.
      if (!key.endsWith('you_lead') && !key.endsWith('tour.stops')) {
        expect(new Set(placeholders(words)), key).toEqual(new Set(placeholders(originals.get(key)!)));
      }
      expect(/^\s/.test(words), key).toBe(/^\s/.test(originals.get(key)!));
    }
  });

  it('is not English', () => {
    const same = [...texts].filter(([key, words]) => words === originals.get(key) && / \w+ /.test(words));
    expect(same).toEqual([]);
  });

  // The page waits for this file before it starts, so the file must not wait for a part of the page.
  it('needs nothing else of the page', () => {
    const written = readFileSync(path.join(source, 'text', `${language}.ts`), 'utf8');
    expect(written.match(/^import .*/gm)).toEqual(["import type { Texts } from './text';"]);
  });
});

it('knows the forms of Arabic plurals', async () => {
  const { tour } = await load_texts('ar');
  const forms = [1, 2, 3, 11, 100].map((count) => tour.stops(count, String(count)));
  expect(forms).toEqual(['محطة واحدة', 'محطتان', '3 محطات', '11 محطة', '100 محطة']);
});

it('writes numbers and times', () => {
  expect(number(1234567)).toBe('1,234,567');
  expect(decimals(2, 1)).toBe('2.0');
  expect(factor(1.68179)).toBe('1.7×');
  expect([0.4, 1, 45, 89.4, 90, 600].map(duration)).toEqual([
    'a moment', '1 second', '45 seconds', '89 seconds', '2 minutes', '10 minutes',
  ]);
});

describe('texts for people', () => {
  /** Files of the client, without the languages and what is generated. */
  const files = readdirSync(source, { recursive: true, encoding: 'utf8' })
    .filter((file) => file.endsWith('.ts') && !/^text\/|generated/.test(file.replaceAll('\\', '/')))
    .map((file) => path.join(source, file));

  /** Errors and warnings are for who looks into the console. Types, imports and selectors are not shown. */
  function is_for_machines(node: ts.Node): boolean {
    const { parent } = node;
    if (ts.isImportDeclaration(parent) || ts.isLiteralTypeNode(parent)) return true;
    for (let at: ts.Node = parent; !ts.isSourceFile(at); at = at.parent) {
      if (ts.isStatement(at)) return false;
      const called = ts.isCallExpression(at) || ts.isNewExpression(at) ? at.expression.getText() : '';
      if (/^console\.|^require$|Error$|querySelector|matchMedia|\.matches$|message\.startsWith$|\.undecodable$/.test(called)) return true;
    }
    return false;
  }

  /** Two words, or one that begins a sentence. */
  const is_prose = (words: string): boolean => /[a-z]{2,} [a-z]{2,}/i.test(words) || /^[A-Z][a-z]{2,}( |$)/.test(words);

  // Shaders, markup and names that browsers give.
  const not_prose = /^#version|^\s*<iframe|^\d+px |^double tap$|^(Key|Page|Arrow|Escape|Space|Tab|Shift|Numpad)[A-Z]?[a-z]*$|^(OffscreenCanvas|WebSocket|Worker|Notification|Bearer |noopener noreferrer)$/;

  it('are in the files of the languages alone', () => {
    const loose: string[] = [];
    for (const file of files) {
      const tree = ts.createSourceFile(file, readFileSync(file, 'utf8'), ts.ScriptTarget.ES2022, true);
      const look = (node: ts.Node): void => {
        const is_literal = ts.isStringLiteralLike(node) || ts.isTemplateHead(node) || ts.isTemplateMiddleOrTemplateTail(node);
        if (is_literal && is_prose(node.text) && !not_prose.test(node.text) && !is_for_machines(node)) {
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

// The compiler refuses a language that lacks a text, or has one too many.
it('is typed against English', () => {
  const lacking = { ...english, modes: { orbit: '', fly: '' } };
  // @ts-expect-error: `walk` is missing
  const wrong: Texts = lacking;
  // @ts-expect-error: there is no `swim`
  const too_much: Texts['modes'] = { orbit: '', fly: '', walk: '', swim: '' };
  expect([wrong, too_much]).toHaveLength(2);
});
