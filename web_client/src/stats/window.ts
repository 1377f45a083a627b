/** Time-stamped values of the last `span_us`, oldest first; at most `capacity` of them. */
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
    this.trim(time_us);
  }

  /** Values that are not older than the span at `now_us`. */
  values(now_us: number): readonly number[] {
    this.trim(now_us);
    return this.values_;
  }

  private trim(now_us: number): void {
    let first = Math.max(0, this.values_.length - this.capacity_);
    while (first < this.times_us_.length && this.times_us_[first]! < now_us - this.span_us_) ++first;
    if (first === 0) return;
    this.times_us_.splice(0, first);
    this.values_.splice(0, first);
  }
}

/** Nearest-rank percentile, `p` in 0…1; NaN for no values. */
export function percentile(values: readonly number[], p: number): number {
  if (values.length === 0) return NaN;
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.max(0, Math.ceil(p * sorted.length) - 1)]!;
}

export const sum = (values: readonly number[]): number => values.reduce((a, b) => a + b, 0);
