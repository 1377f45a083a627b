/** Undefined where the visitor blocks site data: browsers then throw on mere access. */
export function session_storage(): Storage | undefined {
  try {
    return sessionStorage;
  } catch {
    return undefined;
  }
}

export function local_storage(): Storage | undefined {
  try {
    return localStorage;
  } catch {
    return undefined;
  }
}
