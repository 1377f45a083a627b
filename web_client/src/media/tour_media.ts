// Loads what shows and plays the media of tours, where it is needed.
import { load_part } from '../base/load_part';
import { Signal } from '../base/signal';
import type { AccessToken } from '../session/token';
import type { TourState } from '../tour/player';
import { has_media, type Tour } from '../tour/tour';
import type { TourMediaPart } from '../ui/scene_tours';
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
