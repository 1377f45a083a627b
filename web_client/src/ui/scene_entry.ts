// What happens when a visitor enters a scene: the shared view of the address, then the tours.
import type { TourEditor } from '../author/tour_editor';
import type { PageParts } from '../page/parts';
import { start_mode } from '../session/camera_messages';
import { scene_name, scene_words } from '../session/scenes';
import { readers, text } from '../text/text';
import type { SceneAbout } from '../tour/draft';
import { fetch_tours, read_document, type TourDocument } from '../tour/load';
import type { MeasureList } from '../tour/measure_list';
import { measures_for, measures_of_link, type Measure } from '../tour/measures';
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
  readonly editor: Promise<TourEditor> | undefined; // of authors; it may load for long
  readonly embed: EmbedApi;
  readonly measures: MeasureList;
}

export class SceneEntry {
  private loads_ = 0;

  constructor(
    private readonly page_: PageParts,
    private readonly parts_: EntryParts,
  ) {
    const { travel, views } = parts_;
    page_.navigation.entered.listen(({ scene }) => void this.enter(scene));
    page_.navigation.up_changed.listen(() => page_.notice.withdraw(text.quality.up_doubtful));
    page_.worker.on('welcome', ({ welcome: { watching, scene, scenePass } }) => {
      if (watching && scene && scenePass) void this.watch(scene.sceneId, scenePass);
    });
    page_.worker.on('lead', ({ lead: { scenePass } }) => {
      // Visitors who do not watch have none, and need none.
      if (scenePass && page_.token.pass) page_.token.pass = scenePass;
    });
    window.addEventListener('hashchange', () => {
      if (travel.leads_elsewhere) return;
      const shared = read_shared(location.href);
      views.show(shared);
      views.show_stop(shared);
      const linked = measures_of_link(location.href);
      this.show_linked(linked.measures);
      this.say_unread(linked.problems);
    });
  }

  private async enter(scene: SceneFacts): Promise<void> {
    const scene_id = scene.sceneId;
    const { navigation, notice, toolbar } = this.page_;
    const { scenes, tours: shown, views, travel, editor, embed, measures: list } = this.parts_;
    const token = this.page_.token.value;
    const load = ++this.loads_;
    this.page_.token.pass = '';
    const arrival = travel.arrive(scene_id);
    const shared = arrival ?? read_shared(location.href);
    const linked = measures_of_link(arrival ? location.origin : location.href);
    list.enter([], []);
    list.set_scale(scene.metresPerUnit || undefined);
    this.show_linked(linked.measures);
    views.show(shared);
    if (scene.upIsDoubtful && !navigation.chosen_up)
      notice.show(text.quality.up_doubtful, 20, {
        label: text.quality.flip,
        take: () => navigation.turn_over(),
      });
    const { document, may_save } = await fetch_tours(location.href, token, scene_id);
    if (load !== this.loads_) return; // the visitor entered another scene meanwhile
    const { camera } = navigation;
    const read = this.read(document);
    const { tours, start, problems, measures } = read;
    await scenes.learn(tours);
    if (load !== this.loads_) return;
    for (const problem of problems) notice.show(text.tour.unreadable({ why: problem }));
    this.say_unread([...read.unread_measures, ...linked.problems]);
    if (start) {
      camera.start_at(start);
      if (!shared.eye && !navigation.led) navigation.reset();
    }
    // Authors see each text in the language that they edit.
    const readable = tours_for(tours, editor ? [] : readers);
    shown.offer(readable);
    if (!editor) list.enter(list.own, measures_for(measures, readers));
    // No tour starts by itself for an author, or for a visitor whose link leads to a view or a stop.
    const has_view = shared.eye !== undefined || shared.stop_index !== undefined;
    shown.load(readable, has_view || editor !== undefined || navigation.led);
    views.show_stop(shared, true);
    travel.arrived();
    const stops = (readable[0]?.stops ?? []).map(({ title }) => title);
    embed.say({ catgs: 'ready', scene: scene_name(scene_id), stops });
    const ready = await editor;
    if (!ready || load !== this.loads_) return;
    ready.load(tours, about_of(scene), may_save ? token : undefined, document.etag, measures);
    if (load === 1) toolbar.open('author');
  }

  private say_unread(problems: readonly string[]): void {
    for (const why of problems) this.page_.notice.show(text.measure.unreadable({ why }));
  }

  private show_linked(linked: readonly Measure[]): void {
    if (linked.length === 0) return;
    this.parts_.measures.join(linked);
    // Frames of other pages have no panels.
    if (!document.body.classList.contains('bare')) this.page_.toolbar.open('measure');
  }

  /** Gets ready to show what the host shows of this scene's tours. */
  private async watch(scene_id: string, pass: string): Promise<void> {
    const load = ++this.loads_;
    const { token } = this.page_;
    const { document } = await fetch_tours(location.href, token.value, scene_id, pass);
    if (load !== this.loads_) return;
    this.parts_.measures.enter([], []); // those of the scene before
    token.pass = pass;
    const { tours: shown } = this.parts_;
    const readable = tours_for(this.read(document).tours, readers);
    shown.offer(readable, scene_id);
    shown.load(readable, true);
  }

  private read(document: TourDocument): ReturnType<typeof read_document> {
    const { navigation, view } = this.page_;
    const { up, start_fov_y_rad } = navigation.camera;
    return read_document(
      document,
      up,
      start_fov_y_rad,
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
