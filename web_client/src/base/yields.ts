const longest_ms = 6; // a frame has 16

/** Lets the page draw between the pieces of long work. */
export class Yields {
  private begun_ms_ = performance.now();

  /** Call it often. */
  async if_due(): Promise<void> {
    if (performance.now() - this.begun_ms_ < longest_ms) return;
    await new Promise((resolve) => setTimeout(resolve));
    this.begun_ms_ = performance.now();
  }
}
