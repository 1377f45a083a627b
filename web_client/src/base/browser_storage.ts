/** Texts that outlast the page. Neither method throws. */
export type KeptTexts = Pick<Storage, 'getItem' | 'setItem'>;

/**
 * The only user of browser storage. Where that is blocked, full or broken, texts last as long as the page:
 * browsers throw on mere access, on each read, or on each write.
 */
export function browser_storage(kind: 'localStorage' | 'sessionStorage'): KeptTexts {
  const texts = new Map<string, string>();
  let warned = false;
  const attempt = <T>(use: (storage: Storage) => T): T | undefined => {
    try {
      return use(window[kind]);
    } catch (error) {
      if (!warned) console.warn(`${kind} cannot be used`, error);
      warned = true;
      return undefined;
    }
  };
  return {
    getItem: (key) => texts.get(key) ?? attempt((storage) => storage.getItem(key)) ?? null,
    setItem(key, text) {
      texts.set(key, text);
      attempt((storage) => storage.setItem(key, text));
    },
  };
}
