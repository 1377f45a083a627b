// A tour that an author is editing, and the sidecar made from it. Pure.
import type { SceneSetup } from '../camera/scene_setup';
import { write_tours, type Stop, type Tour } from './tour';

export class TourDraft {
  private stops_: readonly Stop[] = [];
  title = '';
  starts_itself = false;
  private others_: readonly Tour[] = []; // other tours of the scene, kept as they are

  /** Edits the first tour that has stops. */
  load(tours: readonly Tour[]): void {
    const edited = tours.find(({ way }) => way === undefined);
    this.title = edited?.title ?? '';
    this.stops_ = edited?.stops ?? [];
    this.starts_itself = edited?.starts_itself ?? false;
    this.others_ = tours.filter((tour) => tour !== edited);
  }

  get stops(): readonly Stop[] {
    return this.stops_;
  }

  get tours(): readonly Tour[] {
    const { title, stops, starts_itself } = this;
    const edited = { title, stops, way: undefined, starts_itself };
    return stops.length > 0 ? [edited, ...this.others_] : this.others_;
  }

  add(stop: Stop): void {
    this.stops_ = [...this.stops_, stop];
  }

  remove(index: number): void {
    this.stops_ = this.stops_.filter((_, i) => i !== index);
  }

  change(index: number, change: Partial<Stop>): void {
    this.stops_ = this.stops_.map((stop, i) => (i === index ? { ...stop, ...change } : stop));
  }

  /** Swaps a stop with its neighbour. `by`: 1 or -1. */
  move(index: number, by: number): void {
    const [stop, neighbour] = [this.stops_[index], this.stops_[index + by]];
    if (!stop || !neighbour) return;
    this.stops_ = this.stops_.map((other, i) =>
      i === index ? neighbour : i === index + by ? stop : other,
    );
  }

  /** The whole of `<scene>.json`: the facts of the scene and the tours. */
  sidecar(scene: SceneSetup): object {
    const limited = scene.limits_max.some((v, i) => v > scene.limits_min[i]!);
    return {
      up: scene.up,
      start_pose: { position: scene.start_pose.position, orientation: scene.start_pose.orientation },
      near: scene.near_z,
      ...(limited && { limits: { min: scene.limits_min, max: scene.limits_max } }),
      focus: scene.focus,
      tours: write_tours(this.tours),
    };
  }
}
