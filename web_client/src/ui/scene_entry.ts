// What happens when a visitor enters a scene: the shared view of the address, then the tours.
import type { TourEditor } from '../author/tour_editor';
import type { PageParts } from '../page/parts';
import { start_mode } from '../session/camera_messages';
import { scene_name, scene_words } from '../session/scenes';
import { readers, text } from '../text/text';
import type { SceneAbout } from '../tour/draft';
import { fetch_tours, read_document, type TourDocument } from '../tour/load';
import { read_shared } from '../tour/share';
import { tours_for } from '../tour/tour';
import type { SceneFacts } from '../wire/wire';
import type { EmbedApi } from './embed';
import type { PortalScenes } from './portal_scenes';
import type { PortalTravel } from './portal_travel';
import { css_colour } from './scene_title';
import type { SceneTours } from './scene_tours';
import type { SharedViews } from './shared_views';

interface EntryParts {
  readonly scenes: PortalScenes;
  readonly tours: SceneTours;
  readonly views: SharedViews;
  readonly travel: PortalTravel;
  readonly editor: TourEditor | undefined; // of authors
  readonly embed: EmbedApi;
}

export class SceneEntry {
  private loads_ = 0;

  constructor(
    private readonly page_: PageParts,
    private readonly parts_: EntryParts,
  ) {
    const { travel, views } = parts_;
    page_.navigation.entered.listen(({ scene }) => void this.enter(scene));
    page_.worker.on('welcome', ({ welcome: { watching, scene, scenePass } }) => {
      if (watching && scene && scenePass) void this.watch(scene.sceneId, scenePass);
    });
    window.addEventListener('hashchange', () => {
      if (travel.leads_elsewhere) return;
      const shared = read_shared(location.href);
      views.show(shared);
      views.show_stop(shared);
    });
  }

  private async enter(scene: SceneFacts): Promise<void> {
    const scene_id = scene.sceneId;
    const { navigation, notice, toolbar } = this.page_;
    const { scenes, tours: shown, views, travel, editor, embed } = this.parts_;
    const token = this.page_.token.value;
    const load = ++this.loads_;
    this.page_.token.pass = '';
    const shared = travel.arrive(scene_id) ?? read_shared(location.href);
    views.show(shared);
    const { document, may_save } = await fetch_tours(location.href, token, scene_id);
    if (load !== this.loads_) return; // the visitor entered another scene meanwhile
    const { camera } = navigation;
    const { tours, start, problems } = this.read(document);
    await scenes.learn(tours);
    if (load !== this.loads_) return;
    for (const problem of problems) notice.show(text.tour.unreadable({ why: problem }));
    if (start) {
      camera.start_at(start);
      if (!shared.eye && !navigation.led) navigation.reset();
    }
    // Authors see each text in the language that they edit.
    const readable = tours_for(tours, editor ? [] : readers);
    shown.offer(readable);
    editor?.load(tours, about_of(scene), may_save ? token : undefined, document.etag);
    // No tour starts by itself for an author, or for a visitor whose link leads to a view or a stop.
    const has_view = shared.eye !== undefined || shared.stop_index !== undefined;
    shown.load(readable, has_view || editor !== undefined || navigation.led);
    if (load === 1 && editor) toolbar.open('author');
    views.show_stop(shared, true);
    travel.arrived();
    const stops = (readable[0]?.stops ?? []).map(({ title }) => title);
    embed.say({ catgs: 'ready', scene: scene_name(scene_id), stops });
  }

  /** Gets ready to show what the host shows of this scene's tours. */
  private async watch(scene_id: string, pass: string): Promise<void> {
    const load = ++this.loads_;
    const { token } = this.page_;
    const { document } = await fetch_tours(location.href, token.value, scene_id, pass);
    if (load !== this.loads_) return;
    token.pass = pass;
    const { tours: shown } = this.parts_;
    const readable = tours_for(this.read(document).tours, readers);
    shown.offer(readable, scene_id);
    shown.load(readable, true);
  }

  private read(document: TourDocument): ReturnType<typeof read_document> {
    const { navigation, view } = this.page_;
    const { up, fov_y_rad } = navigation.camera;
    return read_document(
      document,
      up,
      fov_y_rad,
      view.clientWidth / Math.max(1, view.clientHeight),
    );
  }
}

/** What the scene's sidecar says. The name of its file is no title. */
function about_of(scene: SceneFacts): SceneAbout {
  return {
    ...scene_words(scene),
    title: scene.title === scene_name(scene.sceneId) ? '' : scene.title,
    licence: scene.licence,
    mode: start_mode(scene),
    background: css_colour(scene.backgroundRgb),
    metres_per_unit: scene.metresPerUnit,
  };
}
