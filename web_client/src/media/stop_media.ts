// The pictures, films and sounds of a stop, in the card of the tour.
import { by_id, make } from '../page/dom';
import { text } from '../text/text';
import type { Medium } from '../tour/media';
import type { MediaAddresses } from './addresses';
import { show_large } from './large_picture';

interface FilmListener {
  /** A film or a sound of the card begins or stops to play. */
  plays(playing: boolean): void;
  /** The visitor looks at a picture in the whole window. */
  enlarged(): void;
}

export class StopMedia {
  private readonly host_ = make('div', {
    id: 'tour-media',
    role: 'group',
    'aria-label': text.media.of_stop,
  });
  private shown_: readonly Medium[] = [];
  private films_: HTMLMediaElement[] = [];
  private muted_ = false;

  constructor(private readonly listener_: FilmListener) {
    by_id('tour', HTMLElement).prepend(this.host_);
    // The keys of a film, and those that scroll, are not those of the page.
    this.host_.addEventListener('keydown', (event) => {
      if (event.target instanceof HTMLMediaElement || event.target === this.host_)
        event.stopPropagation();
    });
  }

  show(media: readonly Medium[], addresses: MediaAddresses): void {
    if (media === this.shown_) return;
    this.shown_ = media;
    for (const film of this.films_) film.pause();
    this.films_ = [];
    this.host_.replaceChildren(...media.map((medium) => this.figure_of(medium, addresses)));
    this.host_.classList.toggle('several', media.length > 1);
    this.host_.removeAttribute('tabindex');
    this.host_.scrollLeft = 0;
  }

  mute(muted: boolean): void {
    this.muted_ = muted;
    for (const film of this.films_) film.muted = muted;
  }

  private figure_of(medium: Medium, addresses: MediaAddresses): HTMLElement {
    const figure = make('figure', {});
    const fail = (): void => {
      const said = make('span', { dir: 'auto', lang: medium.language }, medium.alt || medium.src);
      figure.replaceChildren(
        make('p', { className: 'missing' }, text.media.missing, make('br'), said),
      );
      this.host_.tabIndex = 0; // what is left may hold nothing to reach by Tab
    };
    if (medium.kind === 'image') figure.append(this.picture_of(medium, addresses, fail));
    else figure.append(this.film_of(medium, addresses, fail));
    return figure;
  }

  private picture_of(medium: Medium, addresses: MediaAddresses, fail: () => void): HTMLElement {
    const picture = make('img', { alt: medium.alt, lang: medium.language, onerror: fail });
    void addresses.of(medium.src).then((address) => (picture.src = address));
    const button = make(
      'button',
      { type: 'button', title: text.media.enlarge, 'aria-haspopup': 'dialog' },
      picture,
    );
    button.addEventListener('click', () => {
      this.listener_.enlarged();
      show_large(picture.src, medium);
    });
    return button;
  }

  private film_of(medium: Medium, addresses: MediaAddresses, fail: () => void): HTMLElement {
    const film = make(medium.kind === 'video' ? 'video' : 'audio', {
      controls: true,
      preload: 'metadata',
      muted: this.muted_,
      onerror: fail,
      'aria-label': medium.alt || text.media.kinds[medium.kind],
    });
    film.setAttribute('playsinline', '');
    void addresses.of(medium.src).then((address) => (film.src = address));
    if (medium.captions) film.append(captions_track(medium.captions, addresses, true));
    let plays = false;
    const tell = (playing: boolean): void => {
      if (playing !== plays) this.listener_.plays(playing);
      plays = playing;
    };
    film.addEventListener('play', () => {
      for (const other of this.films_) if (other !== film) other.pause();
      tell(true);
    });
    for (const end of ['pause', 'ended', 'error']) film.addEventListener(end, () => tell(false));
    this.films_.push(film);
    return film;
  }
}

/** A track of captions. Without `shown`, the page shows them itself. */
export function captions_track(
  name: string,
  addresses: MediaAddresses,
  shown: boolean,
): HTMLTrackElement {
  const track = make('track', { kind: 'captions', label: text.media.captions, default: true });
  void addresses.of(name).then((address) => {
    track.src = address;
    track.track.mode = shown ? 'showing' : 'hidden'; // it loads
  });
  return track;
}
