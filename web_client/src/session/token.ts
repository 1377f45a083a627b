import type { KeptTexts } from '../base/browser_storage';

const storage_key = 'catgs.token';
const most_bytes = 512; // that the wire takes

/** Servers close the connection of a client that sends any other text as its token. */
function can_be_token(text: string): boolean {
  const controls = Array.from(text.slice(0, most_bytes)).some((c) => c < ' ' || c === '\x7f');
  return !controls && new TextEncoder().encode(text).length <= most_bytes;
}

const fragment_of = (href: string): URLSearchParams =>
  new URLSearchParams(new URL(href).hash.slice(1));

export const has_token = (href: string): boolean => fragment_of(href).has('token');

/** The watch token of a link to a presentation; '' for none. It stays in the address, for reloads. */
export function watch_token(href: string): string {
  const token = fragment_of(href).get('watch') ?? '';
  return can_be_token(token) ? token : '';
}

/** The access token of this visitor; '' for none. The tab remembers it. */
export class AccessToken {
  /** Opens tours and media of the scene that this visitor watches; '': it watches none. */
  pass = '';
  private value_: string;

  /**
   * Moves the token out of the URL's fragment, so that the address bar, the history and copied links do
   * not show it. Fragments never reach a server or its logs. A text that cannot be a token is dropped:
   * remembered, it would keep this tab out for good.
   */
  constructor(
    location: Pick<Location, 'href'>,
    history: Pick<History, 'replaceState' | 'state'>,
    private readonly storage_: KeptTexts,
  ) {
    this.value_ = storage_.getItem(storage_key) ?? '';
    const url = new URL(location.href);
    const fragment = fragment_of(location.href);
    const token = fragment.get('token');
    if (token === null) return;
    fragment.delete('token');
    url.hash = fragment.toString();
    history.replaceState(history.state, '', url.href.replace(/#$/, ''));
    if (can_be_token(token)) this.value = token;
  }

  get value(): string {
    return this.value_;
  }

  /** Until the page is loaded again. */
  set_aside(): void {
    this.value_ = '';
  }

  set value(token: string) {
    this.value_ = token;
    this.storage_.setItem(storage_key, token);
  }
}
