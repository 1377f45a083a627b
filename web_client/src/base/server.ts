/** Asks the server for `path` below /api/, with the token where this visitor has one. */
export function ask_server(
  page_url: string,
  token: string,
  path: string,
  { headers, ...request }: Omit<RequestInit, 'headers'> & { headers?: Record<string, string> } = {},
): Promise<Response> {
  // A proxy with a login of its own needs Authorization for that.
  const own: Record<string, string> = token ? { 'catgs-token': token } : {};
  return fetch(server_address(page_url, path), {
    ...request,
    headers: { ...headers, ...own },
  });
}

/** The address of `path` below /api/. */
export const server_address = (page_url: string, path: string): URL =>
  new URL(`./api/${path}`, page_url);

/** Path of something that belongs to a scene. */
export const scene_path = (scene_id: string, what: string): string =>
  `scenes/${encodeURIComponent(scene_id)}/${what}`;
