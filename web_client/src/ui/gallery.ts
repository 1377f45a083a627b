// The first page of a server with several scenes: a picture of each.
import { by_id, make } from '../page/dom';
import {
  credit_line,
  await_poster,
  scene_address,
  scene_labels,
  type SceneListing,
} from '../session/scenes';
import { text } from '../text/text';

export function show_gallery(scenes: readonly SceneListing[], token: string): void {
  const labels = scene_labels(scenes);
  const list = by_id('gallery-scenes', HTMLUListElement);
  const pictures = new Map<Element, string>();
  // Pictures are fetched as they come into view, because there may be thousands.
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting || !(target instanceof HTMLImageElement)) continue;
      seen.unobserve(target);
      void show_poster(target, pictures.get(target) ?? '', token);
    }
  });
  list.replaceChildren(
    ...scenes.map((scene, i) => {
      const picture = make('img', { alt: '', width: 960, height: 540 });
      pictures.set(picture, scene.id);
      seen.observe(picture);
      const link = make(
        'a',
        { href: scene_address(location.href, scene.id) },
        ...[
          picture,
          make('strong', { dir: 'auto' }, labels[i] ?? scene.id),
          make('small', { dir: 'auto' }, credit_line(scene)),
        ],
      );
      return make('li', {}, link);
    }),
  );
  by_id('gallery', HTMLElement).hidden = false;
  for (const id of ['view', 'toolbar', 'card']) by_id(id, HTMLElement).hidden = true;
  document.title = `${text.page.scenes} – CaT-GS`;
}

async function show_poster(
  picture: HTMLImageElement,
  scene_id: string,
  token: string,
): Promise<void> {
  const poster = await await_poster(location.href, token, scene_id);
  if (poster) picture.src = URL.createObjectURL(poster);
}
