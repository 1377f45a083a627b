import type { Notice } from '../page/notice';
import type { SessionState } from '../session/state';
import { text } from '../text/text';
import type { WorkerClient } from '../worker/client';
import type { CardView } from './card';

const tones_hz = [660, 880] as const;
const tone_s = 0.18;
const loudness = 0.2;

/**
 * Calls visitors who wait for a slot and look elsewhere meanwhile. The title of the tab has their position in
 * the queue, and then says that it is their turn. Who asked for it hears two tones, too, and gets a
 * notification.
 */
export class TurnCall {
  private waits_ = false;
  private prefix_ = ''; // of the page's own title
  private sound_: AudioContext | undefined; // undefined: nobody asked to be called

  constructor(
    private readonly card_: CardView,
    private readonly notice_: Notice,
    worker: WorkerClient,
  ) {
    worker.on('state', ({ state }) => this.changed(state));
    card_.call_wanted.listen(() => this.prepare());
    const seen = (): void => {
      if (!this.waits_ && this.is_seen()) this.set_prefix('');
    };
    document.addEventListener('visibilitychange', seen);
    window.addEventListener('focus', seen);
  }

  private changed(state: SessionState): void {
    if (state.phase === 'queued' && !state.for_scene) {
      this.waits_ = true;
      this.set_prefix(`(${state.position}) `);
    } else if (state.phase === 'live' && this.waits_) {
      this.waits_ = false;
      this.call();
    } else if (state.phase === 'failed') {
      this.waits_ = false;
      this.hang_up();
      this.set_prefix('');
    }
  }

  /** Browsers let a page sound and ask for notifications after a gesture only, so this is the time. */
  private prepare(): void {
    this.sound_ = new AudioContext();
    this.sound();
    this.notice_.show(text.turn.will_call, 10);
    const permission = globalThis.Notification as typeof Notification | undefined;
    if (permission?.permission === 'default') {
      permission
        .requestPermission()
        .catch((error: unknown) => console.warn('no notifications', error));
    }
  }

  private call(): void {
    this.set_prefix(this.is_seen() ? '' : text.turn.in_title);
    this.notice_.show(text.turn.now, 10);
    if (!this.sound_) return;
    this.sound();
    this.card_.call_over();
    setTimeout(() => this.hang_up(), 2000); // the tones are over by then
    if (document.hidden) this.notify();
  }

  /** Browsers limit how many sounds a page may hold. */
  private hang_up(): void {
    void this.sound_?.close();
    this.sound_ = undefined;
  }

  private notify(): void {
    if (!('Notification' in window) || Notification.permission !== 'granted') return;
    try {
      new Notification(text.turn.now, { tag: 'catgs-turn' }).onclick = () => window.focus();
    } catch (error) {
      console.warn('this browser has no notifications for pages', error); // Chrome on Android
    }
  }

  private sound(): void {
    const sound = this.sound_;
    if (!sound) return;
    const volume = new GainNode(sound, { gain: loudness });
    volume.connect(sound.destination);
    tones_hz.forEach((frequency, i) => {
      const tone = new OscillatorNode(sound, { frequency });
      const begin_s = sound.currentTime + i * tone_s;
      tone.connect(volume);
      tone.start(begin_s);
      tone.stop(begin_s + tone_s);
    });
  }

  private is_seen(): boolean {
    return !document.hidden && document.hasFocus();
  }

  private set_prefix(prefix: string): void {
    const own = document.title.startsWith(this.prefix_)
      ? document.title.slice(this.prefix_.length)
      : document.title;
    this.prefix_ = prefix;
    document.title = prefix + own;
  }
}
