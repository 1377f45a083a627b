const storage_key = 'catgs.token';

/**
 * Takes the access token out of the URL's fragment, so that neither the address bar nor the history
 * nor a copied link shows it, and remembers it for this tab. Fragments never reach a server or its
 * logs. Returns '' when there is none.
 */
export function take_token(
  location: Pick<Location, 'href'>,
  history: Pick<History, 'replaceState' | 'state'>,
  storage: Storage | undefined,
): string {
  const url = new URL(location.href);
  const fragment = new URLSearchParams(url.hash.slice(1));
  const token = fragment.get('token');
  if (token === null) return storage?.getItem(storage_key) ?? '';
  fragment.delete('token');
  url.hash = fragment.toString();
  history.replaceState(history.state, '', url.href.replace(/#$/, ''));
  remember_token(token, storage);
  return token;
}

export function remember_token(token: string, storage: Storage | undefined): void {
  storage?.setItem(storage_key, token);
}
