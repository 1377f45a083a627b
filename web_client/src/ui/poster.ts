import { ask_server, scene_path } from '../base/server';
import { list_scenes } from '../session/scenes';
import { by_id } from './dom';

/** Shows a still of the scene until the first picture arrives, which takes long in a queue. */
export class Poster {
  private readonly image_ = by_id('poster', HTMLImageElement);
  private over_ = false;

  /** `scene_id`: empty for the server's first scene. */
  async show(page_url: string, scene_id: string, token: string): Promise<void> {
    try {
      const id = scene_id || (await list_scenes(page_url, token))[0];
      if (!id) return;
      const response = await ask_server(page_url, token, scene_path(id, 'poster.jpg'));
      if (!response.ok) return;
      const blob = await response.blob();
      if (this.over_ || !blob.type.startsWith('image/')) return;
      this.image_.src = URL.createObjectURL(blob);
      this.image_.hidden = false;
    } catch (error) {
      console.warn('no poster could be shown', error);
    }
  }

  /** The first picture has arrived. */
  end(): void {
    if (this.over_) return;
    this.over_ = true;
    this.image_.classList.add('over'); // fades
    setTimeout(() => {
      this.image_.hidden = true;
      URL.revokeObjectURL(this.image_.src);
      this.image_.removeAttribute('src');
    }, 400);
  }
}
