import { by_id, make } from '../page/dom';
import { credit_line, scene_address, scene_words } from '../session/scenes';
import { number } from '../text/number';
import { readers, text } from '../text/text';
import { in_language } from '../text/translations';
import type { SceneFacts } from '../wire/wire';

/** Shows the name of the scene and whom it is from. `several`: this visitor may see other scenes, too. */
export function show_scene_title(scene: SceneFacts, several: boolean): void {
  const { title, credits, language: lang = '' } = in_language(scene_words(scene), readers);
  const name = title || scene.sceneId;
  const count = text.scene.gaussians({ count: number(scene.gaussians) });
  const what = scene.model === '' ? count : `${count}, ${scene.model}`;
  by_id('scene-name', HTMLElement).replaceChildren(
    make('bdi', { lang }, name),
    make('small', {}, what),
  );
  by_id('scene-credits', HTMLElement).textContent = credit_line({
    credits,
    licence: scene.licence,
  });
  const all = by_id('all-scenes', HTMLAnchorElement);
  all.href = scene_address(location.href);
  all.hidden = !several;
  by_id('scene-title', HTMLElement).hidden = false;
  by_id('view', HTMLElement).style.background = css_colour(scene.backgroundRgb);
  document.title = `${name} – CaT-GS`;
}

/** "#rrggbb" of 0xRRGGBB. */
export const css_colour = (rgb: number): string => `#${rgb.toString(16).padStart(6, '0')}`;
