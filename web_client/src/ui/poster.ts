import { by_id } from '../page/dom';
import { await_poster } from '../session/scenes';

/** Shows a still of the scene until the first picture arrives, which takes long in a queue. */
export class Poster {
  private readonly image_ = by_id('poster', HTMLImageElement);
  private over_ = false;

  async show(page_url: string, scene_id: string, token: string): Promise<void> {
    const poster = await await_poster(page_url, token, scene_id, () => this.over_);
    if (!poster) return;
    this.image_.src = URL.createObjectURL(poster);
    this.image_.hidden = false;
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
