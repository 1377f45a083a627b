// The media folder of a scene on the server, for its author.
import { ask_server, scene_path, server_address } from '../base/server';
import { number } from '../text/number';
import { text } from '../text/text';
import { max_media_bytes } from '../tour/limits';
import { kind_of, type MediaKind } from '../tour/media';
import { refusal } from '../tour/save';

export class MediaFolder {
  /** Names of the files that are there. */
  names: readonly string[] = [];
  private readonly sending_ = new Set<string>(); // names that are taken, too

  constructor(
    readonly scene_id: string,
    private readonly token_: string,
  ) {}

  async look(): Promise<void> {
    try {
      const response = await ask_server(
        location.href,
        this.token_,
        scene_path(this.scene_id, 'media'),
      );
      if (!response.ok) return;
      const { media } = (await response.json()) as { media: readonly { readonly name: string }[] };
      this.names = media.map(({ name }) => name);
    } catch (error) {
      console.warn('the media of the scene could not be listed', error);
    }
  }

  of_kind(kinds: readonly (MediaKind | 'captions')[]): readonly string[] {
    return this.names.filter((name) => kinds.some((kind) => kind === kind_of(name)));
  }

  /** Sends a file; resolves with the name that it has there. Throws an error that people can read. */
  async add(file: File, progress: (words: string) => void): Promise<string> {
    if (file.size > max_media_bytes) throw new Error(text.media.too_large);
    const other = await other_format(file);
    if (other) throw new Error(text.media.not_shown({ name: file.name, ...other }));
    const name = free_name(file.name, [...this.names, ...this.sending_]);
    this.sending_.add(name);
    const path = scene_path(this.scene_id, `media/${encodeURIComponent(name)}`);
    await send(server_address(location.href, path), this.token_, file, (share) =>
      progress(text.media.sending({ share: number(share, { style: 'percent' }) })),
    ).finally(() => this.sending_.delete(name));
    this.names = [...this.names, name].sort();
    return name;
  }
}

const heic = { format: 'HEIC', instead: 'JPEG' };
const avif = { format: 'AVIF', instead: 'JPEG' };
/** Formats of cameras that tours do not show, by their brands (ISO 14496-12). */
const other_formats: Readonly<Record<string, { format: string; instead: string }>> = {
  ...{ heic, heix: heic, heim: heic, heis: heic, hevc: heic, hevx: heic, mif1: heic, msf1: heic },
  ...{ avif, avis: avif, 'qt  ': { format: 'QuickTime', instead: 'MP4' } },
};

/** The format of a file that tours do not show, if its first bytes tell. */
export async function other_format(
  file: Blob,
): Promise<{ format: string; instead: string } | undefined> {
  const head = new TextDecoder('latin1').decode(await file.slice(0, 12).arrayBuffer());
  return head.slice(4, 8) === 'ftyp' ? other_formats[head.slice(8)] : undefined;
}

/** A name that the server takes and that no other file has. Pure. */
export function free_name(name: string, taken: readonly string[]): string {
  const dot = name.lastIndexOf('.');
  const plain = (part: string): string =>
    part
      .normalize('NFKD')
      .replace(/\p{M}/gu, '')
      .replace(/[^\w-]+/g, '-')
      .replace(/^-+|-+$/g, '');
  const stem = plain(dot > 0 ? name.slice(0, dot) : name).slice(0, 80) || 'file';
  const extension = dot > 0 ? `.${plain(name.slice(dot + 1)).toLowerCase()}` : '';
  const there = new Set(taken.map((name) => name.toLowerCase()));
  for (let n = 1; ; ++n) {
    const free = `${stem}${n > 1 ? `-${n}` : ''}${extension}`;
    if (!there.has(free.toLowerCase())) return free;
  }
}

/** fetch() does not tell how much is sent. */
function send(
  address: URL,
  token: string,
  file: File,
  sent: (share: number) => void,
): Promise<void> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('PUT', address);
    request.setRequestHeader('catgs-token', token);
    request.setRequestHeader('if-none-match', '*');
    request.upload.onprogress = ({ loaded, total }) => sent(loaded / Math.max(1, total));
    request.onload = () => {
      const { status, responseText: answer } = request;
      if (status === 200) resolve();
      else reject(new Error(text.media.not_kept({ why: refusal(status, answer) })));
    };
    request.onerror = () =>
      reject(new Error(text.media.not_kept({ why: text.author.unreachable })));
    request.send(file);
  });
}
