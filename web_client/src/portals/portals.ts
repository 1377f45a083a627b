// Ways from scene to scene. Pure.
import { look_at, type Vec3 } from '../base/vector';
import { scene_name, type SceneListing } from '../session/scenes';
import { watch_token } from '../session/token';
import { share_address, type SharedView } from '../tour/share';
import type { Portal } from '../tour/tour';

/** Where a portal leads for this visitor. Without an id it is closed. */
export interface PortalTarget {
  readonly scene_id: string | undefined;
  readonly title: string;
}

/** `scenes`: those that this visitor may see. A name counts where only one of them has it. */
export function target_of({ scene }: Portal, scenes: readonly SceneListing[]): PortalTarget {
  const named = scenes.filter(({ id }) => scene_name(id) === scene);
  const found =
    scenes.find(({ id }) => id === scene) ?? (named.length === 1 ? named[0] : undefined);
  return { scene_id: found?.id, title: found?.title || scene };
}

/** How links name the scene: by its name where no other has it, because ids differ between servers. */
export function lasting_name(scene_id: string, scenes: readonly SceneListing[]): string {
  const name = scene_name(scene_id);
  return scenes.filter(({ id }) => scene_name(id) === name).length === 1 ? name : scene_id;
}

/** Where a visitor arrives. `up`, `fov_y_rad`: of the scene behind the portal, and the present one. */
export function arrival(
  { view, tour_index, stop_index }: Portal,
  up: Vec3,
  fov_y_rad: number,
): SharedView {
  const orientation = view?.look_at ? look_at(view.position, view.look_at, up) : view?.orientation;
  const eye = view &&
    orientation && { position: view.position, orientation, fov_y_rad: view.fov_y_rad ?? fov_y_rad };
  return { eye, mode: undefined, tour_index, stop_index };
}

/** The page's address with scene and view, and with what else it says of the page. */
export function address_in(page_url: string, scene_id: string, view: SharedView): string {
  const url = new URL(share_address(page_url, scene_id, view));
  for (const [name, value] of new URL(page_url).searchParams) {
    if (name !== 'scene') url.searchParams.append(name, value);
  }
  return url.href;
}

/** The page's address in the scene where another visitor has led this one. Reloaded, it still follows that visitor. */
export function address_led_to(page_url: string, scene_id: string): string {
  const url = new URL(page_url);
  url.searchParams.set('scene', scene_id);
  const watch = watch_token(page_url);
  url.hash = watch && new URLSearchParams({ watch }).toString();
  return url.href;
}
