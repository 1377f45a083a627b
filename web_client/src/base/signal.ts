/** Tells its listeners what happened, in the order in which they began to listen. */
export class Signal<T = void> {
  private readonly listeners_: ((value: T) => void)[] = [];

  listen(listener: (value: T) => void): void {
    this.listeners_.push(listener);
  }

  emit(value: T): void {
    for (const listener of this.listeners_) listener(value);
  }
}
