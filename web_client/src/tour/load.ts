import type { Vec3 } from '../camera/vector';
import type { Eye } from '../present/warp';
import { read_supersplat } from './supersplat';
import { read_tours, type Tour } from './tour';

export interface SceneTours {
  readonly tours: readonly Tour[];
  readonly start: Eye | undefined;
  /** What could not be read, for the author. */
  readonly problems: readonly string[];
}

/** What /api/scenes/ID/tours says, as far as it makes sense. Pure. */
export function read_document(
  document: { readonly tours?: unknown; readonly settings?: unknown },
  up: Vec3,
  fov_y_rad: number,
  aspect: number,
): SceneTours {
  const problems: string[] = [];
  const attempt = <T>(present: unknown, read: () => T): T | undefined => {
    if (present === undefined || present === null) return undefined;
    try {
      return read();
    } catch (error) {
      problems.push(error instanceof Error ? error.message : String(error));
      return undefined;
    }
  };
  const own = attempt(document.tours, () => read_tours(document.tours, up, fov_y_rad)) ?? [];
  const imported = attempt(document.settings, () => read_supersplat(document.settings, aspect));
  return {
    tours: [...own, ...(imported?.tours ?? [])].filter(
      ({ stops, way }) => stops.length > 0 || way !== undefined,
    ),
    start: imported?.start,
    problems,
  };
}

/** Nothing where the server has none, or does not tell. */
export async function fetch_tours(
  page_url: string,
  token: string,
  scene_id: string,
): Promise<{ tours?: unknown; settings?: unknown }> {
  try {
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    const address = new URL(`./api/scenes/${encodeURIComponent(scene_id)}/tours`, page_url);
    const response = await fetch(address, { headers });
    return response.ok ? ((await response.json()) as object) : {};
  } catch (error) {
    console.warn('the tours of the scene could not be read', error);
    return {};
  }
}
