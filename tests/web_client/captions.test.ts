// Captions: what their Markdown says, and what a hostile one cannot do.
import { describe, expect, it } from 'vitest';
import { pieces_of } from '#client/captions/markdown';
import { link_of, may_be_markdown, text_of, type Piece } from '#client/captions/pieces';

const p = (...pieces: Piece[]): Piece => ({ tag: 'p', pieces });

/** All elements of a caption, however deep. */
const elements = (pieces: readonly Piece[]): Exclude<Piece, string>[] =>
  pieces.flatMap((piece) => (typeof piece === 'string' ? [] : [piece, ...elements(piece.pieces)]));

describe('a caption', () => {
  it('says in Markdown what people write', () => {
    expect(
      pieces_of('Built in **1904** by *Ada*,\nsee [her page](https://ada.example/a?b=1&c).'),
    ).toEqual([
      p(
        ...['Built in ', { tag: 'strong', pieces: ['1904'] } as const, ' by '],
        ...[{ tag: 'em', pieces: ['Ada'] } as const, ',\nsee '],
        ...[{ tag: 'a', href: 'https://ada.example/a?b=1&c', pieces: ['her page'] } as const, '.'],
      ),
    ]);
    expect(
      pieces_of('# One\n### Two\n- a\n- b\n\n3. c\n\n> `d`\n\n---\n```\ne\n```').map(
        (piece) => typeof piece !== 'string' && piece.tag,
      ),
    ).toEqual(['h3', 'h4', 'ul', 'ol', 'blockquote', 'hr', 'pre']);
    expect(pieces_of('3. c')).toMatchObject([{ tag: 'ol', start: 3 }]);
  });

  it.each([
    'Built in 1904.',
    'One line.\nAnother: half – and half (2/3), "so".',
    'Don’t! 50% of 3 + 4; a/b',
    '1904 was a year.',
    '広場 「市」',
  ])('of plain words needs no parser: %j', (caption) => {
    expect(may_be_markdown(caption)).toBe(false);
    expect(pieces_of(caption)).toEqual([p(caption)]); // and would say the same with one
  });

  it.each([
    'a **b**',
    '_a_',
    '`a`',
    '# a',
    '> a',
    '- a',
    '+ a',
    '12. a',
    '3) a',
    '[a](b)',
    '<https://a.example>',
    'a\n===',
    'a\n---',
    'a  \nb',
    '&amp;',
    'a\\*',
    '~~~\na',
  ])('may be Markdown: %j', (caption) => expect(may_be_markdown(caption)).toBe(true));

  it('has words alone where no elements may be', () => {
    expect(
      text_of(pieces_of('# The *hall*\n- of [stone](https://a.example)\n- and `wood`')).trim(),
    ).toBe('The hall\nof stone\nand wood');
  });
});

describe('a hostile caption', () => {
  it.each([
    '<script>alert(1)</script>',
    'a <img src=x onerror=alert(1)> b',
    '<svg onload=alert(1)>',
    '<a href="javascript:alert(1)">x</a>',
    '<!-- --><iframe srcdoc="&lt;script&gt;">',
    '<style>* { display: none }</style>',
    '<div>\n\n**x**\n\n</div>',
  ])('has no HTML: %j', (caption) => {
    const pieces = pieces_of(caption);
    expect(elements(pieces).every(({ tag }) => ['p', 'strong'].includes(tag))).toBe(true);
    expect(text_of(pieces)).toContain('<'); // it stays as it is written
  });

  it.each([
    'javascript:alert(1)',
    'JaVaScRiPt:alert(1)',
    ' javascript:alert(1)',
    'java\nscript:alert(1)',
    'java\tscript:alert(1)',
    '\u0001javascript:alert(1)',
    'data:text/html,<script>',
    'vbscript:x',
    'file:///etc/passwd',
    'blob:https://a.example/x',
    'ws://a.example',
    'intent://x#Intent;end',
    '/api/scenes',
    '//evil.example',
    '../x',
    '?scene=x',
    '#token=x',
    '',
    'https://',
    'http://[',
  ])('has no link to %j', (address) => {
    expect(link_of(address)).toBeUndefined();
  });

  it.each([
    'https://a.example/',
    'http://a.example:81/b#c',
    'HTTPS://A.example/',
    'mailto:ada@a.example',
  ])('may have one to %j', (address) => {
    expect(link_of(address)).toBeTruthy();
  });

  it.each([
    ...[
      '[x](javascript:alert(1))',
      '[x](<javascript:alert(1)>)',
      '[x](&#106;avascript:alert(1))',
      '[x](javascript&colon;alert(1))',
    ],
    ...[
      '<javascript:alert(1)>',
      '![x](javascript:alert(1))',
      '![x](https://spy.example/a.png)',
      '[x][y]\n\n[y]: javascript:alert(1)',
    ],
    ...[
      '[x](data:text/html;base64,PHN2Zz4=)',
      '[x](/api/scenes)',
      '[![x](https://spy.example/a.png)](javascript:alert(1))',
    ],
  ])('has no such link, and loads nothing: %j', (caption) => {
    const pieces = pieces_of(caption);
    expect(elements(pieces).filter(({ tag, href }) => tag !== 'p' || href !== undefined)).toEqual(
      [],
    );
    expect(text_of(pieces)).not.toBe('');
  });

  it('is read to its end, whatever its depth', () => {
    // Time grows with the square of the depth. tests/e2e/captions.test.ts has the longest caption.
    const many = (unit: string): string => unit.repeat(Math.floor(240 / unit.length));
    const deep = [
      '>',
      '- ',
      '1. ',
      '*a ',
      '_a',
      '[',
      '![',
      '[a](',
      '`',
      '**',
      '<',
      '&#',
      '\\',
      '>\n\n',
      '* * ',
      '[x](https://a.example)',
      '***a',
      '~~~\n',
      '| ',
    ];
    for (const caption of deep.map(many)) {
      const depth = (pieces: readonly Piece[]): number =>
        1 +
        Math.max(
          0,
          ...pieces.map((piece) => (typeof piece === 'string' ? 0 : depth(piece.pieces))),
        );
      expect(depth(pieces_of(caption)), caption.slice(0, 9)).toBeLessThan(20);
    }
  });
});
