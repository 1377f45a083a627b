import type { SceneFacts } from '../wire/wire';
import { by_id, make } from './dom';
import { show_scene_links } from './scene_links';

/** Shows the name of the scene, with a list of all scenes where there are several. */
export class SceneTitle {
  private readonly chooser_ = by_id('scene-chooser', HTMLDetailsElement);

  constructor() {
    const close = (): void => {
      this.chooser_.open = false;
    };
    this.chooser_.addEventListener('keydown', (event) => {
      if (event.key === 'Escape') close();
    });
    // A click in Safari focuses no link. The list has a tabindex, so that the click focuses the list instead.
    this.chooser_.addEventListener('focusout', ({ relatedTarget }) => {
      if (!(relatedTarget instanceof Node && this.chooser_.contains(relatedTarget))) close();
    });
  }

  /** `scene_ids`: the scenes that this visitor may see. */
  show(scene: SceneFacts, scene_ids: readonly string[]): void {
    const name = scene.title || scene.sceneId;
    const count = `${new Intl.NumberFormat('en').format(scene.gaussians)} Gaussians`;
    by_id('scene-name', HTMLElement).replaceChildren(name, make('small', {}, count));
    show_scene_links('scene-list', scene_ids, scene.sceneId);
    this.chooser_.hidden = scene_ids.length < 2;
    by_id('scene-title', HTMLElement).hidden = false;
    document.title = `${name} – CaT-GS`;
  }
}
