// The voice of a stop in the card of the tour: its button, and its words as text.
import { by_id, icon, make } from '../page/dom';
import { text } from '../text/text';
import type { Narration } from '../tour/media';
import type { MediaAddresses } from './addresses';
import type { Sounds } from './sounds';
import { captions_track } from './stop_media';

export class Narrator {
  private readonly button_ = make('button', { id: 'tour-voice', type: 'button', hidden: true });
  private readonly words_ = make('p', { id: 'tour-words', dir: 'auto', hidden: true });
  private narration_: Narration | undefined;
  private addresses_: MediaAddresses | undefined;

  /** `voice` is the element that `sounds` plays. */
  constructor(
    private readonly voice_: HTMLAudioElement,
    private readonly sounds_: Sounds,
  ) {
    by_id('tour-position', HTMLElement).before(this.button_);
    by_id('tour-controls', HTMLElement).before(this.words_);
    this.button_.append(icon('voice'));
    this.button_.addEventListener('click', () => {
      if (sounds_.speaks) sounds_.hush(true);
      else if (sounds_.voice === 'paused') sounds_.resume();
      else this.begin();
    });
    voice_.addEventListener('ended', () => sounds_.voice_ended());
    voice_.addEventListener('error', () => {
      this.words_.textContent = `${text.media.missing} ${text.media.narration}`;
      this.words_.hidden = false;
      sounds_.voice_ended();
    });
  }

  /** Another stop is shown: nothing speaks any more. */
  show(narration: Narration | undefined, addresses: MediaAddresses): void {
    this.narration_ = narration;
    this.addresses_ = addresses;
    this.words_.textContent = '';
    this.words_.hidden = !narration?.captions;
    this.sounds_.hush();
  }

  /** The visitor is there. */
  async speak(): Promise<void> {
    const { narration_: narration, addresses_: addresses } = this;
    if (!narration || !addresses) return;
    const address = await addresses.of(narration.src);
    if (narration !== this.narration_) return; // the visitor went on meanwhile
    this.voice_.replaceChildren();
    this.sounds_.speak(address);
    if (!narration.captions) return;
    const { track } = this.voice_.appendChild(captions_track(narration.captions, addresses, false));
    track.addEventListener('cuechange', () => {
      const cues = [...(track.activeCues ?? [])] as VTTCue[];
      this.words_.textContent = cues.map((cue) => cue.getCueAsHTML().textContent).join('\n');
    });
  }

  /** The visitor wants to hear it before being there. */
  private begin(): void {
    this.sounds_.touch();
    void this.speak();
  }

  /** Shows the state of the sounds. */
  update(): void {
    const { speaks } = this.sounds_;
    const label = speaks ? text.media.pause_voice : text.media.hear;
    this.button_.hidden = this.narration_ === undefined;
    this.button_.setAttribute('aria-label', label);
    this.button_.title = label;
    this.button_.setAttribute('aria-pressed', String(speaks));
  }
}
