// What a caption may be made of. Pure.

type Tag =
  | 'p'
  | 'h3'
  | 'h4'
  | 'ul'
  | 'ol'
  | 'li'
  | 'blockquote'
  | 'pre'
  | 'code'
  | 'hr'
  | 'em'
  | 'strong'
  | 'br'
  | 'a';

/** A text, or an element. `href`: only of 'a'; see link_of(). */
export type Piece =
  | string
  | {
      readonly tag: Tag;
      readonly pieces: readonly Piece[];
      readonly href?: string;
      readonly start?: number;
    };

/** Whether a caption may say more as Markdown than as it is written. */
export const may_be_markdown = (caption: string): boolean =>
  /[*_`#>[\]\\&~]|<(https?|mailto):|^\s*([-+]|\d+[.)]|-{3,}|={3,})(\s|$)| {2}$/m.test(caption);

/** Where a link of a caption may lead: to other pages and to mail. Undefined for all else, such as scripts. */
export function link_of(address: string): string | undefined {
  let url: URL;
  try {
    url = new URL(address); // an address without a scheme would be one of this server
  } catch {
    return undefined;
  }
  return ['http:', 'https:', 'mailto:'].includes(url.protocol) ? url.href : undefined;
}

/** The texts of pieces alone, for places that hold no elements. */
export const text_of = (pieces: readonly Piece[]): string =>
  pieces
    .map((piece) => {
      if (typeof piece === 'string') return piece;
      const ends_line = !['em', 'strong', 'code', 'a'].includes(piece.tag);
      return text_of(piece.pieces) + (ends_line ? '\n' : '');
    })
    .join('')
    .replace(/\n+/g, '\n');
