/** Ids of the scenes that this token may see; empty when the server does not answer. */
export async function list_scenes(page_url: string, token: string): Promise<readonly string[]> {
  try {
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    const response = await fetch(new URL('./api/scenes', page_url), { headers });
    if (!response.ok) return [];
    const { scenes } = (await response.json()) as { scenes: readonly { id: string }[] };
    return scenes.map(({ id }) => id);
  } catch (error) {
    console.warn('the list of scenes could not be read', error);
    return [];
  }
}

/** The page's address with this scene, or with the server's first one where `scene_id` is empty. */
export function scene_address(page_url: string, scene_id = ''): string {
  const url = new URL(page_url);
  if (scene_id) url.searchParams.set('scene', scene_id);
  else url.searchParams.delete('scene');
  return url.href;
}
