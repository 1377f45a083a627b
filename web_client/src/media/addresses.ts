import { ask_server, scene_path, server_address } from '../base/server';
import type { AccessToken } from '../session/token';
import { is_foreign } from '../tour/media';

const renew_after_ms = 3600_000; // the server's signatures are valid for four hours

/**
 * Where the media of a scene are. Elements of a page cannot send a token, so visitors who have one get
 * signed addresses, as those do who have a pass.
 */
export class MediaAddresses {
  private signature_: { readonly text: Promise<string>; readonly made_ms: number } | undefined;

  constructor(
    private readonly page_url_: string,
    private readonly token_: Pick<AccessToken, 'value' | 'pass'>,
    private readonly scene_id_: string,
  ) {}

  async of(src: string): Promise<string> {
    if (is_foreign(src)) return src;
    const address = server_address(
      this.page_url_,
      scene_path(this.scene_id_, `media/${encodeURIComponent(src)}`),
    );
    const pass = this.token_.pass || (this.token_.value && (await this.signature()));
    if (pass) address.searchParams.set('pass', pass);
    return address.href;
  }

  private signature(): Promise<string> {
    if (!this.signature_ || Date.now() - this.signature_.made_ms > renew_after_ms) {
      this.signature_ = { text: this.ask(), made_ms: Date.now() };
    }
    return this.signature_.text;
  }

  /** Without a signature the server refuses, and the page says that a medium cannot be shown. */
  private async ask(): Promise<string> {
    try {
      const response = await ask_server(
        this.page_url_,
        this.token_.value,
        scene_path(this.scene_id_, 'media-pass'),
      );
      if (response.ok) return await response.text();
    } catch (error) {
      console.warn('the media of the scene cannot be had', error);
    }
    this.signature_ = undefined;
    return '';
  }
}
