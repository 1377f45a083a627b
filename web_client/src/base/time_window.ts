/** Keeps values of the last `span_us` before the newest one, oldest first, and at most `capacity`. */
export class TimeWindow {
  private times_us_: number[] = [];
  private values_: number[] = [];

  constructor(
    private readonly span_us_: number,
    private readonly capacity_ = 2000,
  ) {}

  push(time_us: number, value: number): void {
    this.times_us_.push(time_us);
    this.values_.push(value);
    const first = Math.max(this.first_at(time_us), this.values_.length - this.capacity_);
    if (first === 0) return;
    this.times_us_.splice(0, first);
    this.values_.splice(0, first);
  }

  /** Values of the span that ends at `now_us`. */
  values(now_us: number): readonly number[] {
    return this.values_.slice(this.first_at(now_us));
  }

  /** Values of the span that ended with the newest value, however long ago that was. */
  newest(): readonly number[] {
    return this.values_;
  }

  private first_at(now_us: number): number {
    const first = this.times_us_.findIndex((time_us) => time_us >= now_us - this.span_us_);
    return first < 0 ? this.times_us_.length : first;
  }
}

/** Nearest-rank percentile, `p` in 0…1; NaN for no values. */
export function percentile(values: readonly number[], p: number): number {
  if (values.length === 0) return NaN;
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.max(0, Math.ceil(p * sorted.length) - 1)]!;
}

export const sum = (values: readonly number[]): number => values.reduce((a, b) => a + b, 0);
