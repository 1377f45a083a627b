/**
 * A slot that holds only the newest of what was put in; what it replaces is handed to `discard`.
 * This is the client's whole jitter buffer.
 */
export class Latest<T> {
  private value_: T | undefined;

  constructor(private readonly discard_: (old: T) => void) {}

  put(value: T): void {
    const old = this.value_;
    this.value_ = value;
    if (old !== undefined) this.discard_(old);
  }

  get full(): boolean {
    return this.value_ !== undefined;
  }

  take(): T | undefined {
    const value = this.value_;
    this.value_ = undefined;
    return value;
  }

  clear(): void {
    const old = this.take();
    if (old !== undefined) this.discard_(old);
  }
}
