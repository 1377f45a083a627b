/** Undefined where the visitor blocks site data: browsers then throw on mere access. */
export function browser_storage(kind: 'localStorage' | 'sessionStorage'): Storage | undefined {
  try {
    return window[kind];
  } catch {
    return undefined;
  }
}
