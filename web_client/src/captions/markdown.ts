// Reads captions as Markdown (CommonMark) without HTML. Pure. It loads when a scene has such a caption.
import type { Nodes, Parents } from 'mdast';
import { fromMarkdown } from 'mdast-util-from-markdown';
import { link_of, type Piece } from './pieces';

// HTML stays the text that it is written as. Definitions would be links that nobody sees, and indented code
// is what people write by mistake.
const extensions = [{ disable: { null: ['htmlFlow', 'htmlText', 'definition', 'codeIndented'] } }];
const deepest = 12; // of what stands inside of each other; anything deeper is text

/** What the caption is made of. Whatever Markdown has besides (images) becomes its text. */
export function pieces_of(caption: string): readonly Piece[] {
  return inside(fromMarkdown(caption, { extensions }), 0);
}

const inside = ({ children }: Parents, depth: number): readonly Piece[] =>
  children.flatMap((child) => pieces_of_node(child, depth + 1));

function pieces_of_node(node: Nodes, depth: number): readonly Piece[] {
  if (depth > deepest) return [words_of(node)];
  switch (node.type) {
    case 'paragraph':
      return [{ tag: 'p', pieces: inside(node, depth) }];
    case 'heading':
      return [{ tag: node.depth <= 2 ? 'h3' : 'h4', pieces: inside(node, depth) }];
    case 'list':
      return [
        node.ordered
          ? { tag: 'ol', start: node.start ?? 1, pieces: inside(node, depth) }
          : { tag: 'ul', pieces: inside(node, depth) },
      ];
    case 'listItem':
      return [{ tag: 'li', pieces: inside(node, depth) }];
    case 'blockquote':
      return [{ tag: 'blockquote', pieces: inside(node, depth) }];
    case 'code':
      return [{ tag: 'pre', pieces: [node.value] }];
    case 'inlineCode':
      return [{ tag: 'code', pieces: [node.value] }];
    case 'thematicBreak':
      return [{ tag: 'hr', pieces: [] }];
    case 'break':
      return [{ tag: 'br', pieces: [] }];
    case 'emphasis':
      return [{ tag: 'em', pieces: inside(node, depth) }];
    case 'strong':
      return [{ tag: 'strong', pieces: inside(node, depth) }];
    case 'link': {
      const href = link_of(node.url);
      return href === undefined
        ? inside(node, depth)
        : [{ tag: 'a', href, pieces: inside(node, depth) }];
    }
    default:
      return [words_of(node)];
  }
}

/** The words of a node and of all in it, however deep they are. */
function words_of(node: Nodes): string {
  const words: string[] = [];
  const waiting: Nodes[] = [node];
  for (let next = waiting.pop(); next; next = waiting.pop()) {
    if ('value' in next) words.push(next.value);
    else if ('alt' in next) words.push(next.alt ?? '');
    else if ('children' in next) waiting.push(...[...next.children].reverse());
  }
  return words.join('');
}
