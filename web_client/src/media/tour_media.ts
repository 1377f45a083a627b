// Loads what shows, plays and edits the media of tours, where it is needed.
import type { MediaFields } from '../author/stops';
import { load_part } from '../base/load_part';
import { Signal } from '../base/signal';
import { make } from '../page/dom';
import type { AccessToken } from '../session/token';
import type { TourState } from '../tour/player';
import { has_media, type Stop, type Tour } from '../tour/tour';
import type { TourMediaPart } from '../ui/scene_tours';
import type { AuthorMedia } from './author_media';
import type { MediaPart } from './media_part';

/** Calls before the part is loaded are repeated afterwards. */
export class TourMedia implements TourMediaPart {
  /** The visitor looks at a picture in the whole window. */
  readonly enlarged = new Signal();
  private part_: MediaPart | undefined;
  private loading_ = false;
  private tours_: readonly [scene_id: string, tours: readonly Tour[]] = ['', []];
  private state_: TourState | undefined;
  private arrived_ = false;

  constructor(private readonly token_: Pick<AccessToken, 'value' | 'pass'>) {}

  show_tours(scene_id: string, tours: readonly Tour[]): void {
    this.tours_ = [scene_id, tours];
    if (this.part_) this.part_.show_tours(scene_id, tours);
    else if (tours.some(has_media)) void this.load();
  }

  show(state: TourState): void {
    if (state.stop !== this.state_?.stop) this.arrived_ = false;
    this.state_ = state;
    this.part_?.show(state);
  }

  arrived(): void {
    this.arrived_ = true;
    this.part_?.arrived();
  }

  when_heard(then: () => void): () => void {
    if (this.part_) return this.part_.when_heard(then);
    then();
    return () => undefined;
  }

  private async load(): Promise<void> {
    if (this.loading_) return;
    this.loading_ = true;
    try {
      const { MediaPart: Part } = await load_part(() => import('./media_part'));
      this.part_ = new Part(this.token_, () => this.enlarged.emit());
    } catch (error) {
      console.warn('the media of the tours cannot be shown', error); // the server is away
      this.loading_ = false;
      return;
    }
    this.part_.show_tours(...this.tours_);
    if (this.state_) this.part_.show(this.state_);
    if (this.arrived_) this.part_.arrived();
  }
}

/** The same for the author's fields. */
export class TourMediaFields implements MediaFields {
  private fields_: AuthorMedia | undefined;
  private scene_: readonly [scene_id: string, token: string | undefined] = ['', undefined];

  use(scene_id: string, token: string | undefined): void {
    this.scene_ = [scene_id, token];
    this.fields_?.use(scene_id, token);
  }

  of_stop(
    stop: () => Stop,
    n: string,
    language: string,
    change: (change: Partial<Stop>, field?: string) => void,
  ): HTMLElement {
    return this.filled((fields) => fields.of_stop(stop, n, language, change));
  }

  of_tour(
    tour: Tour,
    language: string,
    change: (change: Partial<Tour>, field?: string) => void,
  ): HTMLElement {
    return this.filled((fields) => fields.of_tour(tour, language, change));
  }

  private filled(fill: (fields: AuthorMedia) => HTMLElement): HTMLElement {
    if (this.fields_) return fill(this.fields_);
    const slot = make('div');
    void load_part(() => import('./author_media')).then(
      ({ AuthorMedia: Fields }) => {
        if (!this.fields_) {
          this.fields_ = new Fields();
          this.fields_.use(...this.scene_);
        }
        slot.replaceWith(fill(this.fields_));
      },
      (error: unknown) => console.warn('media cannot be edited', error),
    );
    return slot;
  }
}
