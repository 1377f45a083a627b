import type { TourEditor } from '../author/tour_editor';
import type { PageParts } from '../page/parts';
import { MeasureList } from '../tour/measure_list';
import { EmbedApi } from './embed';
import { PortalScenes } from './portal_scenes';
import { PortalTravel } from './portal_travel';
import { SceneEntry } from './scene_entry';
import { SceneTours, type TourMediaPart } from './scene_tours';
import { SharePanel } from './share_panel';
import { SharedViews } from './shared_views';

/** Of authors: makes the editor, which may load for long. */
export type MakeEditor = (
  parts: PageParts,
  tours: SceneTours,
  measures: MeasureList,
  list_scenes: PortalScenes['list'],
) => Promise<TourEditor>;

/** Tours, links to views, portals between scenes, the author's editor, and the page around this one. */
export function mount_tours(
  parts: PageParts,
  media: TourMediaPart,
  make_editor: MakeEditor | undefined,
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
  const editor = make_editor?.(parts, tours, measures, () => scenes.list());
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
