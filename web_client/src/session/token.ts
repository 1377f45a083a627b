const storage_key = 'catgs.token';
const most_bytes = 512; // that the wire takes

/** Servers close the connection of who sends another text as a token. */
function can_be_token(text: string): boolean {
  const controls = [...text.slice(0, most_bytes)].some((c) => c < ' ' || c === '\x7f');
  return !controls && new TextEncoder().encode(text).length <= most_bytes;
}

/**
 * Takes the access token out of the URL's fragment, so that neither the address bar nor the history
 * nor a copied link shows it, and remembers it for this tab. Fragments never reach a server or its
 * logs. A text that cannot be a token is dropped: remembered, it would keep this tab out for good.
 * Returns '' when there is none.
 */
export function take_token(
  location: Pick<Location, 'href'>,
  history: Pick<History, 'replaceState' | 'state'>,
  storage: Storage | undefined,
): string {
  const url = new URL(location.href);
  const fragment = new URLSearchParams(url.hash.slice(1));
  const token = fragment.get('token');
  if (token !== null) {
    fragment.delete('token');
    url.hash = fragment.toString();
    history.replaceState(history.state, '', url.href.replace(/#$/, ''));
    if (can_be_token(token)) {
      remember_token(token, storage);
      return token;
    }
  }
  return storage?.getItem(storage_key) ?? '';
}

export function remember_token(token: string, storage: Storage | undefined): void {
  storage?.setItem(storage_key, token);
}
