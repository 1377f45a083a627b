import type { StatsSnapshot } from './metrics';

interface Sample {
  readonly time_s: number; // since the first one
  readonly stats: StatsSnapshot;
}

const span_s = 120;
const capacity = 480; // four a second

/**
 * The statistics of the last two minutes, for plots and for a file. What is older goes by its age, not
 * only by its number: who looks now and then would otherwise keep, and see, samples of an hour.
 */
export class StatsHistory {
  private samples_: Sample[] = [];
  private first_ms_: number | undefined;

  add(stats: StatsSnapshot, now_ms: number): void {
    this.first_ms_ ??= now_ms;
    const time_s = (now_ms - this.first_ms_) / 1000;
    this.samples_.push({ time_s, stats });
    const first = this.samples_.findIndex((sample) => sample.time_s > time_s - span_s);
    this.samples_.splice(0, Math.max(first, this.samples_.length - capacity));
  }

  get samples(): readonly Sample[] {
    return this.samples_;
  }

  /** One value of each sample; null, which JSON and plots know, where nothing was measured. */
  column(value: (stats: StatsSnapshot) => number): (number | null)[] {
    return this.samples_.map(({ stats }) => finite_or_null(value(stats)));
  }

  /** A file for others: what was measured, and by whom. */
  to_json(facts: object, made: string): string {
    return JSON.stringify({ made, ...facts, samples: this.samples_ }, undefined, 1);
  }
}

const finite_or_null = (value: number): number | null => (Number.isFinite(value) ? value : null);
