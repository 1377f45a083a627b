import { Signal } from '../base/signal';
import type { Eye } from '../camera/eye';
import type { WorkerClient } from '../worker/client';
import type { Navigation } from './navigation';

/**
 * The camera of the picture that the visitor sees. A warped picture shows the newest camera, any other picture
 * its own pose. What is drawn over the picture follows that.
 */
export class SeenCamera {
  readonly moved = new Signal<Eye>();
  private warps_ = false;
  private has_picture_ = false;

  constructor(worker: WorkerClient, navigation: Navigation) {
    worker.on('presenter', ({ warps }) => {
      this.warps_ = warps;
    });
    worker.on('presented', ({ pose, fov_y_rad }) => {
      if (!this.warps_ || !this.has_picture_) this.moved.emit({ ...pose, fov_y_rad });
      this.has_picture_ = true;
    });
    navigation.sampled.listen(({ eye }) => {
      if (this.warps_) this.moved.emit(eye);
    });
  }
}
