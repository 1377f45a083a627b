// A tour while its author works on it, and the sidecar that comes of it. Pure.
import type { Eye } from '../camera/eye';
import type { SceneSetup } from '../camera/scene_setup';
import { write_tours, type Stop, type Tour } from './tour';

export class TourDraft {
  private stops_: readonly Stop[] = [];
  private title_ = '';
  private starts_itself_ = false;
  private others_: readonly Tour[] = []; // of the scene; kept as they are
  private start_: Eye | undefined;

  /** The first tour that has stops is the one that is worked on. */
  load(tours: readonly Tour[]): void {
    const edited = tours.find(({ way }) => way === undefined);
    this.title_ = edited?.title ?? '';
    this.stops_ = edited?.stops ?? [];
    this.starts_itself_ = edited?.starts_itself ?? false;
    this.others_ = tours.filter((tour) => tour !== edited);
    this.start_ = undefined;
  }

  get stops(): readonly Stop[] {
    return this.stops_;
  }

  get title(): string {
    return this.title_;
  }

  set title(title: string) {
    this.title_ = title;
  }

  get starts_itself(): boolean {
    return this.starts_itself_;
  }

  set starts_itself(starts: boolean) {
    this.starts_itself_ = starts;
  }

  set start(eye: Eye) {
    this.start_ = eye;
  }

  get tours(): readonly Tour[] {
    const { title_: title, stops_: stops, starts_itself_: starts_itself } = this;
    const edited = { title, stops, way: undefined, starts_itself };
    return this.stops_.length > 0 ? [edited, ...this.others_] : this.others_;
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

  /** Changes places with the neighbour; `by` is 1 or -1. */
  move(index: number, by: number): void {
    const [stop, neighbour] = [this.stops_[index], this.stops_[index + by]];
    if (!stop || !neighbour) return;
    this.stops_ = this.stops_.map((other, i) =>
      i === index ? neighbour : i === index + by ? stop : other,
    );
  }

  /** All of `<scene>.json`: what the scene said of itself, and the tours. */
  sidecar(scene: SceneSetup): object {
    const start = this.start_ ?? scene.start_pose;
    const limited = scene.limits_max.some((v, i) => v > scene.limits_min[i]!);
    return {
      up: scene.up,
      start_pose: { position: start.position, orientation: start.orientation },
      near: scene.near_z,
      ...(limited && { limits: { min: scene.limits_min, max: scene.limits_max } }),
      focus: scene.focus,
      tours: write_tours(this.tours),
    };
  }
}
