import { load_part } from '../base/load_part';
import { ask_server, scene_path } from '../base/server';
import type { Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { read_measures, type Measure } from './measures';
import type { read_supersplat } from './supersplat';
import { read_tours, type Tour } from './tour';

interface SceneTours {
  readonly tours: readonly Tour[];
  readonly start: Eye | undefined;
  readonly measures: readonly Measure[];
  readonly unread_measures: readonly string[];
  /** Errors for the author: parts that could not be read. */
  readonly problems: readonly string[];
}

export interface TourDocument {
  readonly tours?: unknown;
  readonly measures?: unknown;
  readonly settings?: unknown;
  /** Loaded where there are settings. */
  readonly read_settings?: typeof read_supersplat;
  /** Tag of the sidecar; null: there is none. */
  readonly etag?: string | null;
}

/**
 * Reads the answer of /api/scenes/ID/tours as far as it makes sense. Stops come from one source only, so
 * that edited stops do not appear beside the imported ones they replace. The sidecar comes first. Where it
 * has tours, it also says where visits begin. Pure.
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
  const { measures, problems: unread_measures } = read_measures(document.measures);
  const imported = attempt(document.settings, () =>
    document.read_settings?.(document.settings, aspect),
  );
  return {
    tours: [
      ...(own ?? []),
      ...(imported?.tours ?? []).filter(({ way }) => own === undefined || way !== undefined),
    ].filter(({ stops, way }) => stops.length > 0 || way !== undefined),
    start: own === undefined ? imported?.start : undefined,
    measures,
    unread_measures,
    problems,
  };
}

/**
 * Empty where the server has no tours or does not answer. `may_save`: the token may save a sidecar. `pass`: opens
 * the scene in place of the token; '': there is none.
 */
export async function fetch_tours(
  page_url: string,
  token: string,
  scene_id: string,
  pass = '',
): Promise<{ document: TourDocument; may_save: boolean }> {
  const nothing = { document: {}, may_save: false };
  try {
    const query = pass && `?${new URLSearchParams({ pass }).toString()}`;
    const response = await ask_server(page_url, token, scene_path(scene_id, `tours${query}`));
    if (!response.ok) return nothing;
    const answer = { ...nothing, ...((await response.json()) as Partial<typeof nothing>) };
    const document: TourDocument = answer.document;
    if (document.settings === undefined) return answer;
    const { read_supersplat } = await load_part(() => import('./supersplat'));
    return { ...answer, document: { ...document, read_settings: read_supersplat } };
  } catch (error) {
    console.warn('the tours of the scene could not be read', error);
    return nothing;
  }
}
