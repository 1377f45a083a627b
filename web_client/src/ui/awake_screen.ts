/** Keeps the screen on while visitors only watch. Browsers let it go off again when the page is hidden. */
export class AwakeScreen {
  private readonly watched_ = new Set<string>();
  private lock_: Promise<WakeLockSentinel | undefined> | undefined;

  constructor() {
    document.addEventListener('visibilitychange', () => {
      if (document.hidden) this.lock_ = undefined;
      else this.update();
    });
  }

  /** Whether the visitor watches this. */
  watch(what: 'tour' | 'leader', watches: boolean): void {
    if (watches) this.watched_.add(what);
    else this.watched_.delete(what);
    this.update();
  }

  private update(): void {
    const lock = this.lock_;
    if (this.watched_.size === 0) {
      this.lock_ = undefined;
      void lock?.then((held) => held?.release());
    } else if (!lock && !document.hidden) {
      const locks = navigator.wakeLock as WakeLock | undefined; // none without a secure context
      this.lock_ = locks?.request('screen').catch(() => undefined); // the battery is low
    }
  }
}
