// Shows captions with their Markdown. Captions without any need nothing but the page.
import { load_part } from '../base/load_part';
import type { pieces_of } from './markdown';
import { may_be_markdown, text_of, type Piece } from './pieces';

let reader: Promise<{ pieces_of: typeof pieces_of }> | undefined;

/** Loads what reads Markdown, where one of the captions needs it. */
export async function prepare(captions: readonly string[]): Promise<void> {
  if (captions.some(may_be_markdown)) await read('');
}

/** Undefined where the server is away. */
async function read(caption: string): Promise<readonly Piece[] | undefined> {
  try {
    reader ??= load_part(() => import('./markdown'));
    return (await reader).pieces_of(caption);
  } catch (error) {
    console.warn('captions stay as they are written', error);
    reader = undefined;
    return undefined;
  }
}

/** Until then nobody sees the signs of Markdown. */
const late = (): Promise<undefined> =>
  new Promise((resolve) => setTimeout(() => resolve(undefined), 1000));

/** The words of a caption, without its Markdown. */
export async function caption_words(caption: string): Promise<string> {
  if (!may_be_markdown(caption)) return caption;
  const pieces = await read(caption);
  return pieces ? text_of(pieces).trim() : caption;
}

/** Shows one caption after another in an element. */
export class CaptionView {
  private shown_ = '';

  /** `changed` hears when the element holds another caption. */
  constructor(
    private readonly host_: HTMLElement,
    private readonly changed_: () => void,
  ) {}

  async show(caption: string): Promise<void> {
    if (caption === this.shown_) return;
    this.shown_ = caption;
    const reading = may_be_markdown(caption) ? read(caption) : undefined;
    const soon = reading && (await Promise.race([reading, late()]));
    this.fill(caption, soon);
    if (reading && !soon) this.fill(caption, await reading);
  }

  private fill(caption: string, pieces: readonly Piece[] | undefined): void {
    if (caption !== this.shown_) return; // the visitor went on meanwhile
    this.host_.replaceChildren(...(pieces ?? [caption]).map(node_of));
    this.changed_();
  }
}

function node_of(piece: Piece): Node {
  if (typeof piece === 'string') return document.createTextNode(piece);
  const element = document.createElement(piece.tag);
  if (element instanceof HTMLAnchorElement && piece.href !== undefined) {
    element.href = piece.href;
    element.target = '_blank';
    element.rel = 'noopener noreferrer';
  }
  if (element instanceof HTMLOListElement && piece.start !== undefined) element.start = piece.start;
  element.append(...piece.pieces.map(node_of));
  return element;
}
