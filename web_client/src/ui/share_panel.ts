import { by_id, make, on_click, save_file } from '../page/dom';
import type { PageParts } from '../page/parts';
import { file_name_of } from '../session/scenes';
import { text as words } from '../text/text';
import type { MeasureList } from '../tour/measure_list';
import { has_length, type Measure } from '../tour/measures';
import { embed_code, frame_sites } from '../tour/share';

/** The panel with a link, code for other pages, and a picture to save. */
export class SharePanel {
  private readonly link_ = by_id('share-link', HTMLInputElement);
  private readonly done_ = by_id('share-done', HTMLOutputElement);
  private readonly token_ = by_id('share-token', HTMLElement);
  private readonly with_measures_ = by_id('share-with-measures', HTMLInputElement);
  private readonly frames_ = by_id('share-frames', HTMLElement);

  /** `address`: a link to the present view with these measures. */
  constructor(
    private readonly parts_: Pick<PageParts, 'worker' | 'navigation' | 'toolbar' | 'token'>,
    private readonly measures_: MeasureList,
    private readonly address_of_: (measures: readonly Measure[]) => string,
  ) {
    this.with_measures_.addEventListener('change', () => (this.link_.value = this.address));
    on_click('share-copy', () => void this.hand_over(this.address, words.share.link_copied));
    on_click('share-embed', () => {
      void this.hand_over(embed_code(this.address), words.share.code_copied);
      void this.tell_of_frames();
    });
    on_click('share-picture', () => void this.save_picture());
    this.link_.addEventListener('focus', () => this.link_.select());
    parts_.toolbar.panel_shown.listen(({ panel, shown }) => {
      if (panel === 'share' && shown) this.show();
    });
  }

  private get address(): string {
    return this.address_of_(this.with_measures_.checked ? this.measures_.own : []);
  }

  private show(): void {
    by_id('share-measures', HTMLElement).hidden = !this.measures_.own.some(has_length);
    this.link_.value = this.address;
    this.done_.textContent = '';
    this.token_.hidden = this.parts_.token.value === '';
    this.frames_.hidden = true;
  }

  /** Says which sites can show the page. The page's own policy names them. */
  private async tell_of_frames(): Promise<void> {
    try {
      const { headers } = await fetch(location.href, { method: 'HEAD' });
      const sites = frame_sites(headers.get('content-security-policy'));
      this.frames_.hidden = sites === undefined;
      if (sites) {
        this.frames_.textContent =
          sites.length === 0
            ? words.share.no_frames
            : words.share.frames({ sites: sites.join(', ') });
      }
    } catch (error) {
      console.warn('the server did not say who may show this page', error); // the server is away
    }
  }

  /** Copies the text. Pages without a secure context have no clipboard, so visitors copy it by hand there. */
  private async hand_over(text: string, done: string): Promise<void> {
    this.link_.value = text;
    const clipboard = navigator.clipboard as Clipboard | undefined;
    try {
      if (!clipboard) throw new Error('no clipboard');
      await clipboard.writeText(text);
      this.done_.textContent = done;
    } catch {
      this.link_.select();
      this.done_.textContent = words.share.copy_yourself;
    }
  }

  private async save_picture(): Promise<void> {
    const snapshot = await this.parts_.worker.snapshot();
    if (!snapshot) return;
    const { width_px, height_px, rgba } = snapshot;
    const canvas = make('canvas', { width: width_px, height: height_px });
    canvas.getContext('2d')?.putImageData(new ImageData(rgba, width_px, height_px), 0, 0);
    const blob = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve));
    if (blob) save_file(blob, `${file_name_of(this.parts_.navigation.scene_id)}.png`);
  }
}
