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
      const address = new URL(`./api/scenes/${encodeURIComponent(id)}/poster.jpg`, page_url);
      const headers: HeadersInit = token ? { authorization: `Bearer ${token}` } : {};
      const response = await fetch(address, { headers });
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
