import type { StatsSnapshot } from './metrics';

interface Sample {
  readonly time_s: number; // since the first one
  readonly stats: StatsSnapshot;
}

const span_s = 120;
const capacity = 480; // four a second

/**
 * Keeps the statistics of the last two minutes, for plots and for a file. Samples also expire by age.
 * Otherwise a panel that is opened now and then would show samples of an hour.
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

  /** One value per sample; null, which JSON and plots understand, where nothing was measured. */
  column(value: (stats: StatsSnapshot) => number): (number | null)[] {
    return this.samples_.map(({ stats }) => finite_or_null(value(stats)));
  }

  /** The samples as a file for others, with facts about the system that was measured. */
  to_json(facts: object, made: string): string {
    return JSON.stringify({ made, ...facts, samples: this.samples_ }, undefined, 1);
  }
}

const finite_or_null = (value: number): number | null => (Number.isFinite(value) ? value : null);
