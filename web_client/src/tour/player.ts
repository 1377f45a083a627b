// Leads a visitor through a tour. It uses neither page nor clock, so that tests can drive it with fakes.
import type { Timers } from '../base/clock';
import type { Eye } from '../camera/eye';
import { glide, glide_time_s, path_of, type Flight, type PathSample } from '../camera/flight';
import type { Section } from '../camera/section';
import { default_stay_s, flight_to, type Stop, type Tour } from './tour';

interface Guided {
  readonly eye: Eye;
  readonly reach: number;
  fly(way: Flight, ended: (arrived: boolean) => void): void;
  stop_flight(): void;
}

interface TourEnvironment {
  readonly camera: Guided;
  readonly timers: Timers;
  now_us(): number;
  /** Tells the server the path, for its forecasts. */
  announce(path: readonly PathSample[]): void;
  /** What is drawn from now on; undefined: all. */
  show_section(section: Section | undefined): void;
  /** The visitor has come to a stop. */
  reached(tour_index: number, stop_index: number): void;
  /** Calls `then` when nothing speaks at this stop any more, if that is not so now. The result cancels it. */
  when_heard(then: () => void): () => void;
  /** The camera jumps instead of gliding, and no tour starts by itself. */
  readonly reduced_motion: boolean;
}

export interface TourState {
  readonly tour: Tour | undefined;
  readonly tour_index: number;
  /** The stop that is shown or approached; undefined: none yet, or a film. */
  readonly stop: Stop | undefined;
  readonly stop_index: number | undefined;
  readonly playing: boolean;
}

const announced_s = 4; // part of a film told at a time: the wire takes 256 samples
const announce_again_s = 2;

export class TourPlayer {
  private tours_: readonly Tour[] = [];
  private tour_index_ = 0;
  private stop_index_: number | undefined;
  private playing_ = false;
  private at_end_: (() => void) | undefined; // of the last stop; undefined: the tour begins again
  private cancel_ = (): void => undefined;
  private cancel_announcing_ = (): void => undefined;
  private journey_ = 0; // the end of an older journey does not count for this one

  constructor(
    private readonly env_: TourEnvironment,
    private readonly changed_: (state: TourState) => void,
  ) {}

  /** `stays`: no tour starts by itself, whatever it says. */
  load(tours: readonly Tour[], stays = false): void {
    this.pause();
    this.tours_ = tours;
    this.tour_index_ = 0;
    this.stop_index_ = undefined;
    const first = tours.findIndex(({ starts_itself }) => starts_itself);
    if (first >= 0 && !stays && !this.env_.reduced_motion) {
      this.tour_index_ = first;
      this.play();
    }
    this.tell();
  }

  get state(): TourState {
    const tour = this.tours_[this.tour_index_];
    return {
      tour,
      tour_index: this.tour_index_,
      stop: this.stop_index_ === undefined ? undefined : tour?.stops[this.stop_index_],
      stop_index: this.stop_index_,
      playing: this.playing_,
    };
  }

  choose(tour_index: number): void {
    if (!this.tours_[tour_index] || tour_index === this.tour_index_) return;
    this.pause();
    this.tour_index_ = tour_index;
    this.stop_index_ = undefined;
    this.tell();
  }

  go_to(stop_index: number, at_once = this.env_.reduced_motion): void {
    this.playing_ = false;
    this.travel(stop_index, at_once);
  }

  /** Shows the stop's card; the camera stays where it is. */
  show_stop(stop_index: number): void {
    this.pause();
    if (!this.state.tour?.stops[stop_index]) return;
    this.stop_index_ = stop_index;
    this.tell();
    this.env_.reached(this.tour_index_, stop_index);
  }

  /** Shows a stop, or the tour alone, to a visitor whose camera somebody else leads. Undefined: the same tour, no stop. */
  be_shown(tour_index: number | undefined, stop_index: number | undefined): void {
    const index = tour_index ?? this.tour_index_;
    const tour = this.tours_[index];
    if (!tour) return;
    this.set_out();
    this.playing_ = false;
    this.tour_index_ = index;
    this.stop_index_ = stop_index !== undefined && tour.stops[stop_index] ? stop_index : undefined;
    if (this.state.stop) this.env_.show_section(this.state.stop.section);
    this.tell();
  }

  next(): void {
    this.go_by(1);
  }

  previous(): void {
    this.go_by(-1);
  }

  toggle(): void {
    if (this.playing_) this.pause();
    else this.play();
  }

  /** Plays the tour from its first stop to its last one. `ended` is not called where the visitor stops it. */
  play_once(ended: () => void): void {
    this.leave();
    this.at_end_ = ended;
    this.play();
  }

  play(): void {
    const { tour } = this.state;
    if (!tour) return;
    this.playing_ = true;
    if (tour.way) this.run_film(tour.way, tour.way.repeats);
    else
      this.travel(this.stop_index_ === undefined ? 0 : (this.stop_index_ + 1) % tour.stops.length);
  }

  /** Stops playing. The page also calls this when the visitor takes over. */
  pause(): void {
    this.cancel_();
    this.at_end_ = undefined;
    if (!this.playing_) return;
    this.playing_ = false;
    this.env_.camera.stop_flight();
    this.tell();
  }

  /** Stops playing and shows no stop any more. */
  leave(): void {
    this.pause();
    this.stop_index_ = undefined;
    this.tell();
  }

  private go_by(step: number): void {
    const count = this.state.tour?.stops.length ?? 0;
    if (count === 0) return;
    const from = this.stop_index_ ?? (step > 0 ? -1 : 0);
    this.go_to((from + step + count) % count);
  }

  private travel(stop_index: number, at_once = this.env_.reduced_motion): void {
    const stop = this.state.tour?.stops[stop_index];
    if (!stop) return;
    const { camera } = this.env_;
    const from = camera.eye;
    this.stop_index_ = stop_index;
    const way = at_once ? glide(from, stop.eye, 0) : flight_to(stop, from, camera.reach);
    const journey = this.set_out();
    this.env_.show_section(stop.section);
    camera.fly(way, (arrived) => {
      if (journey !== this.journey_) return;
      if (arrived) this.env_.reached(this.tour_index_, stop_index);
      this.ended(arrived, stop);
    });
    this.announce(way, 0, way.duration_s);
    this.tell();
  }

  private ended(arrived: boolean, stop: Stop): void {
    this.cancel_announcing_();
    if (!arrived) {
      this.env_.announce([]);
      this.stopped();
      return;
    }
    if (!this.playing_) return;
    this.cancel_ = this.env_.timers.after((stop.stay_s ?? default_stay_s(stop)) * 1000, () => {
      this.cancel_ = this.env_.when_heard(() => this.go_on());
    });
  }

  private go_on(): void {
    const ended = this.at_end_;
    if (!ended || this.stop_index_ !== (this.state.tour?.stops.length ?? 0) - 1) return this.play();
    this.pause();
    ended();
  }

  private run_film(way: Flight, repeats: boolean): void {
    const { camera } = this.env_;
    this.stop_index_ = undefined;
    const journey = this.set_out();
    const film = (): void => {
      const begin_us = this.env_.now_us();
      camera.fly(way, (arrived) => {
        if (journey !== this.journey_) return;
        this.cancel_announcing_();
        if (arrived && repeats && this.playing_) film();
        else this.stopped();
      });
      const announce = (): void => {
        const time_s = (this.env_.now_us() - begin_us) / 1e6;
        this.announce(way, time_s, Math.min(announced_s, way.duration_s - time_s));
        this.cancel_announcing_ = this.env_.timers.after(announce_again_s * 1000, announce);
      };
      announce();
    };
    const to_start = way.at(0);
    const glide_s = this.env_.reduced_motion ? 0 : glide_time_s(camera.eye, to_start, camera.reach);
    camera.fly(glide(camera.eye, to_start, glide_s), (arrived) => {
      if (journey !== this.journey_) return;
      if (arrived && this.playing_) film();
      else this.stopped();
    });
    this.tell();
  }

  private set_out(): number {
    this.cancel_();
    this.cancel_announcing_();
    this.journey_ += 1;
    return this.journey_;
  }

  private stopped(): void {
    this.playing_ = false;
    this.tell();
  }

  /** Tells the server the part of a flight that begins now, at `from_s`. */
  private announce(way: Flight, from_s: number, length_s: number): void {
    if (!(length_s > 0)) return;
    this.env_.announce(path_of(way, from_s, length_s, this.env_.now_us()));
  }

  private tell(): void {
    this.changed_(this.state);
  }
}
