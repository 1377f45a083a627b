// Views as links share them: where the camera is, in which mode, and at which stop.
import type { Eye } from '../camera/eye';
import type { PageParts } from '../page/parts';
import { text } from '../text/text';
import type { Measure } from '../tour/measures';
import type { TourPlayer } from '../tour/player';
import { share_address, type SharedView } from '../tour/share';

export class SharedViews {
  constructor(
    private readonly parts_: Pick<PageParts, 'navigation' | 'clipping' | 'notice'>,
    private readonly player_: TourPlayer,
  ) {}

  /** The view that the visitor has now. */
  get present(): SharedView {
    const { camera, chosen_up } = this.parts_.navigation;
    const { tour_index, stop_index } = this.player_.state;
    const { section } = this.parts_.clipping;
    return { eye: camera.eye, mode: camera.mode, up: chosen_up, section, tour_index, stop_index };
  }

  /** A link to it, with these measures. */
  address(measures: readonly Measure[]): string {
    return share_address(location.href, this.parts_.navigation.scene_id, this.present, measures);
  }

  /** Up, mode, camera and section of a shared view. */
  show({ eye, mode, up, section }: SharedView): void {
    if (up) this.parts_.navigation.choose_up(up);
    if (mode) this.parts_.navigation.set_mode(mode);
    if (!eye) return;
    if (up) this.parts_.clipping.section = section;
    else this.parts_.clipping.show(section);
    this.player_.pause();
    this.put(eye);
  }

  /** Tour and stop of a shared view. */
  show_stop({ eye, tour_index, stop_index }: SharedView, at_once?: boolean): void {
    if (tour_index !== undefined) this.player_.choose(tour_index);
    if (stop_index === undefined) return;
    if (eye) this.player_.show_stop(stop_index);
    else this.player_.go_to(stop_index, at_once);
  }

  put(eye: Eye): void {
    if (!this.parts_.navigation.put(eye)) this.parts_.notice.show(text.share.outside, 10);
  }
}
