import { scene_address, scene_labels } from '../session/scenes';
import { by_id, make } from './dom';

/** Fills the list with this id with links to the scenes. Hides the list when there are none. */
export function show_scene_links(list_id: string, ids: readonly string[], current?: string): void {
  const list = by_id(list_id, HTMLUListElement);
  list.hidden = ids.length === 0;
  const labels = scene_labels(ids);
  list.replaceChildren(
    ...ids.map((id, i) => {
      const link = make('a', { href: scene_address(location.href, id) }, labels[i] ?? id);
      if (id === current) link.setAttribute('aria-current', 'page');
      return make('li', {}, link);
    }),
  );
}
