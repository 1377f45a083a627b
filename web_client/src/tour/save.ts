// Saves a scene's sidecar to the server. The server accepts it from authors.
import { ask_server, scene_path } from '../base/server';
import { text } from '../text/text';
import { max_sidecar_bytes } from './limits';

/** Tag (ETag) of a sidecar; null: there is none; undefined: the server did not say. */
export type SidecarTag = string | null | undefined;

export type SaveResult =
  | { readonly kind: 'saved'; readonly tag: SidecarTag }
  /** Somebody else saved another sidecar meanwhile. */
  | { readonly kind: 'changed'; readonly tag: SidecarTag }
  | { readonly kind: 'refused'; readonly why: string };

/** Replaces the sidecar only where its tag is still `made_from`. */
export async function save_sidecar(
  page_url: string,
  token: string,
  scene_id: string,
  sidecar: string,
  made_from: SidecarTag,
): Promise<SaveResult> {
  const body = new Blob([sidecar], { type: 'application/json' });
  if (body.size > max_sidecar_bytes)
    return {
      kind: 'refused',
      why: text.author.too_large({ bytes: body.size, most: max_sidecar_bytes }),
    };
  const headers: Record<string, string> = {};
  if (made_from === null) headers['if-none-match'] = '*';
  else if (made_from !== undefined) headers['if-match'] = made_from;
  try {
    const request = { method: 'PUT', body, headers };
    const response = await ask_server(page_url, token, scene_path(scene_id, 'sidecar'), request);
    const tag = response.headers.get('etag');
    if (response.ok) return { kind: 'saved', tag: tag ?? undefined };
    if (response.status === 412) return { kind: 'changed', tag };
    return { kind: 'refused', why: refusal(response.status, await response.text()) };
  } catch {
    return { kind: 'refused', why: text.author.unreachable };
  }
}

/** The first line of the server's answer is "403: reason". A proxy may answer with a page instead. */
export function refusal(status: number, answer: string): string {
  const [line = ''] = answer.split('\n');
  const prefix = `${status}: `;
  return line.startsWith(prefix)
    ? line.slice(prefix.length)
    : text.author.status({ status: String(status) });
}
