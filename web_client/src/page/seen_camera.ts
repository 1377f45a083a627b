import { Signal } from '../base/signal';
import { widened, type Eye } from '../camera/eye';
import type { WorkerClient } from '../worker/client';
import type { Navigation } from './navigation';

/**
 * The camera of the picture that the visitor sees. A warped picture shows the newest camera, any other picture
 * its own pose. Another visitor's picture, which this one watches, has its own shape, and is all in the view.
 * Everything drawn over the picture follows that.
 */
export class SeenCamera {
  readonly moved = new Signal<Eye>();
  private warps_ = false;
  private has_picture_ = false;
  private watches_ = false;
  private picture_aspect_ = 0;

  constructor(
    worker: WorkerClient,
    navigation: Navigation,
    private readonly view_: HTMLElement,
  ) {
    worker.on('presenter', ({ warps }) => {
      this.warps_ = warps;
    });
    worker.on('welcome', ({ welcome }) => (this.watches_ = welcome.watching));
    worker.on('config', ({ config: { widthPx, heightPx } }) => {
      this.picture_aspect_ = widthPx / Math.max(1, heightPx);
    });
    worker.on('presented', ({ eye }) => {
      if (this.watches_) this.moved.emit(this.all_in_view(eye));
      else if (!this.warps_ || !this.has_picture_) this.moved.emit(eye);
      this.has_picture_ = true;
    });
    navigation.sampled.listen(({ eye }) => {
      if (this.warps_) this.moved.emit(eye);
    });
  }

  /** The camera of a picture that is all in the view, as that of a picture which fills it. */
  private all_in_view(eye: Eye): Eye {
    const { clientWidth, clientHeight } = this.view_;
    const taller = Math.max(1, (this.picture_aspect_ * clientHeight) / Math.max(1, clientWidth));
    return widened(eye, taller);
  }
}
