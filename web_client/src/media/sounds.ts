// What is heard: the voice of a stop, the sound of the tour, and films. It uses no page, so that tests can
// drive it with fakes.
import type { KeptTexts } from '../base/browser_storage';

/** An <audio> element, or a fake. */
export interface Playable {
  src: string;
  volume: number;
  muted: boolean;
  play(): Promise<void>;
  pause(): void;
}

interface SoundEnvironment {
  readonly voice: Playable;
  readonly background: Playable;
  /** Whether the visitor has touched the page. Browsers let nothing be heard before. */
  readonly touched: boolean;
  readonly storage: KeptTexts;
  /** The state has changed. */
  changed(): void;
}

const storage_key = 'catgs.muted';
const quiet_share = 0.25; // of the background's volume while something speaks

export class Sounds {
  private touched_: boolean;
  private muted_: boolean;
  private hidden_ = false;
  private voice_: 'none' | 'speaks' | 'paused' = 'none';
  private films_ = 0; // that play
  private background_ = ''; // the address of the tour's sound
  private background_volume_ = 0; // 0: it has none
  private background_plays_ = false;
  private waiting_: (() => void)[] = [];

  constructor(private readonly env_: SoundEnvironment) {
    this.touched_ = env_.touched;
    this.muted_ = env_.storage.getItem(storage_key) === 'yes';
  }

  get muted(): boolean {
    return this.muted_;
  }

  /** Whether the visitor hears what plays. */
  get audible(): boolean {
    return this.touched_ && !this.muted_;
  }

  /** Whether a voice speaks, if perhaps unheard. */
  get speaks(): boolean {
    return this.touched_ && this.voice_ === 'speaks';
  }

  get voice(): 'none' | 'speaks' | 'paused' {
    return this.voice_;
  }

  /** Begins to speak, or waits for the visitor's first touch. */
  speak(address: string): void {
    this.env_.voice.src = address;
    this.voice_ = 'speaks';
    this.update();
  }

  /** `goes_on`: it may be continued. */
  hush(goes_on = false): void {
    if (this.voice_ !== 'none') this.voice_ = goes_on ? 'paused' : 'none';
    this.env_.voice.pause();
    this.update();
  }

  resume(): void {
    this.touched_ = true;
    if (this.voice_ === 'paused') this.voice_ = 'speaks';
    this.update();
  }

  /** The voice came to its end, or cannot be had. */
  voice_ended(): void {
    if (this.voice_ === 'speaks') this.voice_ = 'paused';
    this.update();
  }

  /** The sound of the tour; an empty address: none. */
  set_background(address: string, volume: number): void {
    const { background } = this.env_;
    this.background_volume_ = address ? volume : 0;
    if (address !== this.background_) {
      background.pause();
      this.background_plays_ = false;
      if (address) background.src = address;
    }
    this.background_ = address;
    this.update();
  }

  /** A film begins or stops to play. A voice does not speak over it. */
  film(plays: boolean): void {
    this.films_ = Math.max(0, this.films_ + (plays ? 1 : -1));
    if (plays) this.touched_ = true; // by its own button
    if (plays && this.voice_ === 'speaks') this.hush(true);
    else this.update();
  }

  /** The page is hidden, or seen again. */
  hide(hidden: boolean): void {
    this.hidden_ = hidden;
    this.update();
  }

  /** The visitor has touched the page for the first time. */
  touch(): void {
    if (this.touched_) return;
    this.touched_ = true;
    this.update();
  }

  /** What the sound button does. */
  toggle(): void {
    this.muted_ = this.audible;
    this.touched_ = true;
    this.env_.storage.setItem(storage_key, this.muted_ ? 'yes' : 'no');
    this.update();
  }

  /** Calls `then` once nothing speaks. The result cancels it. */
  when_heard(then: () => void): () => void {
    this.waiting_.push(then);
    this.tell_waiting();
    return () => (this.waiting_ = this.waiting_.filter((other) => other !== then));
  }

  private update(): void {
    const { voice, background } = this.env_;
    voice.muted = this.muted_;
    if (this.speaks && !this.hidden_) this.start(voice);
    else voice.pause();
    const ducked = this.speaks || this.films_ > 0;
    background.volume = this.background_volume_ * (ducked ? quiet_share : 1);
    const plays = this.background_volume_ > 0 && this.audible && !this.hidden_;
    if (plays && !this.background_plays_) this.start(background);
    else if (!plays) background.pause();
    this.background_plays_ = plays;
    this.env_.changed();
    this.tell_waiting();
  }

  /** A browser that refuses waits for a touch. Every other failure is the element's own error. */
  private start(what: Playable): void {
    what.play().catch((error: unknown) => {
      if (!(error instanceof Error && error.name === 'NotAllowedError') || !this.touched_) return;
      this.touched_ = false;
      this.background_plays_ = false;
      this.update();
    });
  }

  private tell_waiting(): void {
    if (this.speaks || this.films_ > 0) return;
    for (const then of this.waiting_.splice(0)) then();
  }
}
