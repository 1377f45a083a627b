// Orders pictures and films from the server, which draws them for authors.
import { ask_server, scene_path } from '../base/server';

export interface FilmRequest {
  readonly kind: 'picture' | 'panorama' | 'film';
  readonly size: readonly [number, number];
  readonly views: readonly (readonly number[] | number)[];
  /** What is drawn: x, y, z, a quaternion, and half of the sides; undefined: all. */
  readonly box?: readonly number[] | undefined;
}

/** How the file's name ends, after that of the scene. A picture and a panorama of a scene may lie in one folder. */
export const film_endings: Readonly<Record<FilmRequest['kind'], string>> = {
  picture: '.png',
  panorama: '-360.png',
  film: '.mp4',
};

export interface FilmState {
  readonly state: 'waiting' | 'drawing' | 'done' | 'failed' | 'cancelled';
  readonly share: number;
  readonly seconds_left?: number;
  readonly error?: string;
}

/** Returns the id of the job, or why there is none; '': the server does not answer. */
export async function order_film(
  page_url: string,
  token: string,
  scene_id: string,
  film: FilmRequest,
): Promise<{ readonly id: string } | { readonly why: string }> {
  try {
    const request = { method: 'PUT', body: JSON.stringify(film) };
    const response = await ask_server(page_url, token, scene_path(scene_id, 'films'), request);
    if (response.ok) return (await response.json()) as { id: string };
    const [line = ''] = (await response.text()).split('\n');
    return { why: line.replace(/^\d+: /, '') };
  } catch {
    return { why: '' };
  }
}

/** Undefined: the server does not answer. */
export async function film_state(page_url: string, id: string): Promise<FilmState | undefined> {
  try {
    const response = await ask_server(page_url, '', `films/${id}`);
    if (response.status === 404) return { state: 'cancelled', share: 0 };
    return response.ok ? ((await response.json()) as FilmState) : undefined;
  } catch {
    return undefined;
  }
}

export const film_address = (page_url: string, id: string): string =>
  new URL(`./api/films/${id}/file`, page_url).href;

export async function cancel_film(page_url: string, id: string): Promise<void> {
  await ask_server(page_url, '', `films/${id}/cancel`, { method: 'PUT', body: '{}' }).catch(
    () => undefined,
  );
}
