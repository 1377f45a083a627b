import { load_part } from './base/load_part';
import type { MakeEditor } from './ui/mount_tours';

/** Asks for the editor until it comes. The author is told while it is missing (load_part). */
export async function load_author_page(
  load = () => import('./author_page'),
): Promise<typeof import('./author_page')> {
  for (;;) {
    try {
      return await load_part(load);
    } catch (error) {
      console.warn('the editor is not there yet', error); // the server is away
    }
  }
}

export const make_editor: MakeEditor = async (...parts) => {
  const { TourEditor, AuthorMedia } = await load_author_page();
  return new TourEditor(...parts, new AuthorMedia());
};
