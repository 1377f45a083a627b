// Links that lead back to a view. The view is in the fragment, which no server sees. Pure.
import { normalize, short_coordinate, unit, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { camera_modes, type CameraMode } from '../camera/mode';
import { section_of, type Section } from '../camera/section';
import { text } from '../text/text';
import { add_to_link, type Measure } from './measures';

export interface SharedView {
  readonly eye: Eye | undefined;
  readonly mode: CameraMode | undefined;
  /** Unit; undefined: the scene's own. */
  readonly up?: Vec3 | undefined;
  /** Undefined: all of the scene is drawn. */
  readonly section?: Section | undefined;
  readonly tour_index: number | undefined;
  readonly stop_index: number | undefined;
}

/** The page's address with scene, view and measures. It contains no token, because links are for others. */
export function share_address(
  page_url: string,
  scene_id: string,
  view: SharedView,
  measures: readonly Measure[] = [],
): string {
  const url = new URL(page_url);
  const parameters = new URLSearchParams();
  if (scene_id) parameters.set('scene', scene_id);
  url.search = parameters.toString();
  const fragment = new URLSearchParams();
  if (view.eye) {
    const { position, orientation, fov_y_rad, view_height } = view.eye;
    const numbers = [...position, ...orientation, (fov_y_rad * 180) / Math.PI];
    fragment.set('at', numbers.map((v) => String(short_coordinate(v, 6))).join(','));
    if (view_height) fragment.set('height', String(short_coordinate(view_height, 6)));
  }
  if (view.section)
    fragment.set('section', view.section.map((v) => short_coordinate(v, 6)).join(','));
  if (view.mode) fragment.set('mode', view.mode);
  if (view.up) fragment.set('up', view.up.map((v) => String(Number(v.toPrecision(6)))).join(','));
  if (view.tour_index) fragment.set('tour', String(view.tour_index + 1));
  if (view.stop_index !== undefined) fragment.set('stop', String(view.stop_index + 1));
  add_to_link(fragment, measures);
  url.hash = fragment.toString().replaceAll('%2C', ',');
  return url.href;
}

/** The page's address for those who follow the session of this watch token. */
export function presentation_address(
  page_url: string,
  scene_id: string,
  watch_token: string,
): string {
  const nowhere = { eye: undefined, mode: undefined, tour_index: undefined, stop_index: undefined };
  const url = new URL(share_address(page_url, scene_id, nowhere));
  url.hash = new URLSearchParams({ watch: watch_token }).toString();
  return url.href;
}

/** Reads an address of share_address(). Members are undefined where it has nothing or nonsense. */
export function read_shared(page_url: string): SharedView {
  const fragment = new URLSearchParams(new URL(page_url).hash.slice(1));
  const ordinal = (key: string): number | undefined => {
    const found = fragment.get(key) ?? '';
    return /^[1-9]\d{0,3}$/.test(found) ? Number(found) - 1 : undefined;
  };
  const mode = camera_modes.find((name) => name === fragment.get('mode'));
  return {
    eye: read_eye(fragment.get('at') ?? '', Number(fragment.get('height'))),
    mode,
    up: read_up(fragment.get('up') ?? ''),
    section: section_of((fragment.get('section') ?? '').split(',').map(Number)),
    tour_index: ordinal('tour'),
    stop_index: ordinal('stop'),
  };
}

function read_up(written: string): Vec3 | undefined {
  const parts = written.split(',');
  const up = parts.map(Number);
  const [x, y, z] = up as [number, number, number];
  const good = parts.length === 3 && Math.abs(Math.hypot(x, y, z) - 1) < 0.01;
  return good ? normalize([x, y, z], [0, -1, 0]) : undefined;
}

function read_eye(written: string, view_height: number): Eye | undefined {
  const parts = written.split(',');
  const numbers = parts.map(Number);
  const [px, py, pz, x, y, z, w, fov_deg] = numbers as [
    number,
    number,
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  const good =
    parts.length === 8 &&
    parts.every((part) => part.trim() !== '') &&
    numbers.every((v) => Number.isFinite(v) && Math.abs(v) < 1e9) &&
    Math.abs(Math.hypot(x, y, z, w) - 1) < 0.01 &&
    fov_deg >= 5 &&
    fov_deg <= 160;
  if (!good) return undefined;
  return {
    position: [px, py, pz],
    orientation: unit([x, y, z, w]),
    fov_y_rad: (fov_deg * Math.PI) / 180,
    ...(view_height >= 1e-6 && view_height < 1e9 && { view_height }),
  };
}

/**
 * Sites that may show a page with this Content-Security-Policy header in a frame; undefined: all may. The
 * server names them (--embed-origin). Where a proxy adds a policy of its own, both must name a site.
 */
export function frame_sites(header: string | null): readonly string[] | undefined {
  return (header ?? '')
    .split(',')
    .map(sites_of_policy)
    .reduce((both, sites) =>
      both && sites ? both.filter((site) => sites.includes(site)) : (both ?? sites),
    );
}

function sites_of_policy(policy: string): readonly string[] | undefined {
  const directives = policy.split(';').map((directive) => directive.trim().split(/\s+/));
  const sites = directives.find(([name]) => name === 'frame-ancestors')?.slice(1);
  return sites?.includes('*') ? undefined : sites?.filter((site) => site !== "'none'");
}

/** HTML for pages of others. The server names those that may show it (--embed-origin). */
export function embed_code(address: string): string {
  const url = new URL(address);
  url.searchParams.set('ui', '0');
  const source = url.href.replaceAll('&', '&amp;').replaceAll('"', '&quot;');
  return `<iframe src="${source}" style="width:100%;aspect-ratio:16/9;border:0" allow="fullscreen; gamepad; screen-wake-lock; xr-spatial-tracking" title="${text.share.frame_title}"></iframe>`;
}
