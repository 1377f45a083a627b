// The author's editor in the page: what it edits is shown and played at once.
import type { Eye } from '../camera/eye';
import { section_about } from '../camera/upright_box';
import type { PageParts } from '../page/parts';
import type { SceneListing } from '../session/scenes';
import type { SceneAbout } from '../tour/draft';
import type { MeasureList } from '../tour/measure_list';
import type { Measure } from '../tour/measures';
import type { TourPlayer } from '../tour/player';
import type { SidecarTag } from '../tour/save';
import type { Tour } from '../tour/tour';
import { AuthorPanel } from './panel';
import { Preview } from './preview';
import type { MediaFields } from './stops';

/** Where visitors see tours. */
interface TourStage {
  readonly player: TourPlayer;
  offer(tours: readonly Tour[]): void;
}

export class TourEditor {
  private readonly panel_: AuthorPanel;
  private first_start_: Eye | undefined; // of the scene, as visitors get it

  /** `scenes`: those that this author may see. */
  constructor(
    private readonly parts_: Pick<PageParts, 'navigation' | 'clipping' | 'toolbar'>,
    tours: TourStage,
    measures: MeasureList,
    scenes: () => Promise<readonly SceneListing[]>,
    media: MediaFields,
  ) {
    const { navigation, clipping, toolbar } = parts_;
    const { camera } = navigation;
    const { player } = tours;
    const preview = new Preview(player, toolbar, navigation, clipping);
    navigation.taken_over.listen(() => preview.forget());
    this.panel_ = new AuthorPanel({
      navigation,
      clipping,
      section: () =>
        clipping.section && section_about(clipping.section, camera.up, navigation.own_up),
      player,
      preview,
      scenes,
      changed: (edited, index) => {
        preview.forget();
        tours.offer(edited);
        player.load(edited, true);
        player.choose(index);
      },
      media,
      measures,
      start_at: (eye) => camera.start_at(eye ?? this.first_start_),
    });
    toolbar.keep_usable('author', () => this.panel_.is_unsaved);
    navigation.up_changed.listen(() => this.panel_.scene_changed());
  }

  /** See AuthorPanel. */
  load(
    tours: readonly Tour[],
    about: SceneAbout,
    token: string | undefined,
    made_from: SidecarTag,
    measures: readonly Measure[],
  ): void {
    this.first_start_ = this.parts_.navigation.camera.start;
    this.panel_.load(tours, about, token, made_from, measures);
  }

  /** The scene has this scale from now on. */
  readonly set_scale = (metres_per_unit: number): void =>
    this.panel_.edit_about({ metres_per_unit });
}
