import { ask_server } from '../base/server';

/** Ids of the scenes that this token may see; empty when the server does not answer. */
export async function list_scenes(page_url: string, token: string): Promise<readonly string[]> {
  try {
    const response = await ask_server(page_url, token, 'scenes');
    if (!response.ok) return [];
    const { scenes } = (await response.json()) as { scenes: readonly { id: string }[] };
    return scenes.map(({ id }) => id);
  } catch (error) {
    console.warn('the list of scenes could not be read', error);
    return [];
  }
}

/** What people call the scene: its id ("hall-kdfmqrtv") without the digest of its path. */
export function scene_name(scene_id: string): string {
  return scene_id.replace(/^(.+)-[b-df-hjkmnp-tv]{8}$/, '$1');
}

/** Names for a list of scenes, and ids where several have the same name. */
export function scene_labels(scene_ids: readonly string[]): readonly string[] {
  const names = scene_ids.map(scene_name);
  const seen = new Set<string>();
  const shared = new Set(names.filter((name) => seen.size === seen.add(name).size));
  return names.map((name, i) => (shared.has(name) ? (scene_ids[i] ?? name) : name));
}

/** The page's address with this scene, or with the server's first one where `scene_id` is empty. */
export function scene_address(page_url: string, scene_id = ''): string {
  const url = new URL(page_url);
  if (scene_id) url.searchParams.set('scene', scene_id);
  else url.searchParams.delete('scene');
  return url.href;
}
