import type { TourEditor } from '../author/tour_editor';
import { load_part } from '../base/load_part';
import type { PageParts } from '../page/parts';
import { MeasureList } from '../tour/measure_list';
import { EmbedApi } from './embed';
import { PortalScenes } from './portal_scenes';
import { PortalTravel } from './portal_travel';
import { SceneEntry } from './scene_entry';
import { SceneTours, type TourMediaPart } from './scene_tours';
import { SharePanel } from './share_panel';
import { SharedViews } from './shared_views';

/** Asks for the editor until it comes. The author is told while it is missing (load_part). */
export async function load_author_page(
  load = () => import('../author_page'),
): Promise<typeof import('../author_page')> {
  for (;;) {
    try {
      return await load_part(load);
    } catch (error) {
      console.warn('the editor is not there yet', error); // the server is away
    }
  }
}

/** Tours, links to views, portals between scenes, the author's editor, and the page around this one. */
export function mount_tours(
  parts: PageParts,
  media: TourMediaPart,
  is_author: boolean,
): {
  readonly tours: SceneTours;
  readonly measures: MeasureList;
  readonly set_scale: TourEditor['set_scale'] | undefined;
} {
  const { navigation } = parts;
  const scenes = new PortalScenes(parts);
  const tours = new SceneTours(parts, scenes, media);
  const measures = new MeasureList();
  const views = new SharedViews(parts, tours.player);
  const travel = new PortalTravel(parts, () => views.present);
  tours.portal_taken.listen(({ scene_id, portal }) => travel.enter(portal, scene_id));
  const list_scenes = (): ReturnType<PortalScenes['list']> => scenes.list();
  const editor = is_author
    ? load_author_page().then(
        ({ TourEditor, AuthorMedia }) =>
          new TourEditor(parts, tours, measures, list_scenes, new AuthorMedia()),
      )
    : undefined;
  new SharePanel(parts, measures, (shared) => views.address(shared));
  const { player } = tours;
  const embed = new EmbedApi({ player, navigation, put: (eye) => views.put(eye) });
  tours.shown.listen(({ stop_index, playing }) =>
    embed.say({ catgs: 'stop', stop: stop_index ?? null, playing }),
  );
  new SceneEntry(parts, { scenes, tours, views, travel, editor, embed, measures });
  const set_scale: TourEditor['set_scale'] = (scale) =>
    void editor?.then((ready) => ready.set_scale(scale));
  return { tours, measures, set_scale: editor && set_scale };
}
