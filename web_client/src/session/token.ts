const storage_key = 'catgs.token';

/** The access token of this visitor; '' for none. The tab remembers it. */
export class AccessToken {
  private value_: string;

  /**
   * Moves the token out of the URL's fragment, so that the address bar, the history and copied links do
   * not show it. Fragments never reach a server or its logs.
   */
  constructor(
    location: Pick<Location, 'href'>,
    history: Pick<History, 'replaceState' | 'state'>,
    private readonly storage_: Storage | undefined,
  ) {
    this.value_ = storage_?.getItem(storage_key) ?? '';
    const url = new URL(location.href);
    const fragment = new URLSearchParams(url.hash.slice(1));
    const token = fragment.get('token');
    if (token === null) return;
    fragment.delete('token');
    url.hash = fragment.toString();
    history.replaceState(history.state, '', url.href.replace(/#$/, ''));
    this.value = token;
  }

  get value(): string {
    return this.value_;
  }

  set value(token: string) {
    this.value_ = token;
    this.storage_?.setItem(storage_key, token);
  }
}
