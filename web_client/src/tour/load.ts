import type { Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { read_supersplat } from './supersplat';
import { read_tours, type Tour } from './tour';

interface SceneTours {
  readonly tours: readonly Tour[];
  readonly start: Eye | undefined;
  /** What could not be read, for the author. */
  readonly problems: readonly string[];
}

interface TourDocument {
  readonly tours?: unknown;
  readonly settings?: unknown;
  /** Of the sidecar; null: there is none. */
  readonly etag?: string | null;
}

/**
 * What /api/scenes/ID/tours says, as far as it makes sense. Pure. Stops come from one place, so that
 * an author's changes to imported ones do not stand beside the old: the sidecar's, where it has any,
 * and then visits begin where the sidecar says too.
 */
export function read_document(
  document: TourDocument,
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
  const own = attempt(document.tours, () => read_tours(document.tours, up, fov_y_rad));
  const imported = attempt(document.settings, () => read_supersplat(document.settings, aspect));
  return {
    tours: [
      ...(own ?? []),
      ...(imported?.tours ?? []).filter(({ way }) => own === undefined || way !== undefined),
    ].filter(({ stops, way }) => stops.length > 0 || way !== undefined),
    start: own === undefined ? imported?.start : undefined,
    problems,
  };
}

/** Nothing where the server has none, or does not tell. `may_save`: it takes this token's sidecar. */
export async function fetch_tours(
  page_url: string,
  token: string,
  scene_id: string,
): Promise<{ document: TourDocument; may_save: boolean }> {
  const nothing = { document: {}, may_save: false };
  try {
    const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
    const address = new URL(`./api/scenes/${encodeURIComponent(scene_id)}/tours`, page_url);
    const response = await fetch(address, { headers });
    return response.ok ? { ...nothing, ...((await response.json()) as object) } : nothing;
  } catch (error) {
    console.warn('the tours of the scene could not be read', error);
    return nothing;
  }
}
