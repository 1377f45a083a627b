// Shows and plays the media of tours. The page loads it when a tour has some.
import { browser_storage } from '../base/browser_storage';
import { by_id, make } from '../page/dom';
import { text } from '../text/text';
import type { AccessToken } from '../session/token';
import type { TourState } from '../tour/player';
import type { Stop, Tour } from '../tour/tour';
import { MediaAddresses } from './addresses';
import { Narrator } from './narrator';
import { Sounds } from './sounds';
import { StopMedia } from './stop_media';

export class MediaPart {
  private readonly button_ = by_id('button-sound', HTMLButtonElement);
  private readonly background_ = make('audio', { loop: true, preload: 'none' });
  private readonly sounds_: Sounds;
  private readonly narrator_: Narrator;
  private readonly media_: StopMedia;
  private addresses_: MediaAddresses;
  private addresses_for_ = ''; // scene, token and whether there is a pass
  private tour_: Tour | undefined;
  private stop_: Stop | undefined;
  private playing_ = false;

  /** `enlarged`: as in TourMedia. */
  constructor(
    private readonly token_: Pick<AccessToken, 'value' | 'pass'>,
    enlarged: () => void,
  ) {
    this.addresses_ = new MediaAddresses(location.href, token_, '');
    const voice = make('audio', { preload: 'auto' });
    this.sounds_ = new Sounds({
      voice,
      background: this.background_,
      touched: 'userActivation' in navigator && navigator.userActivation.hasBeenActive,
      storage: browser_storage('localStorage'),
      changed: () => this.update(),
    });
    this.narrator_ = new Narrator(voice, this.sounds_);
    this.media_ = new StopMedia({ plays: (playing) => this.sounds_.film(playing), enlarged });
    by_id('tour', HTMLElement).append(voice);
    this.button_.addEventListener('click', () => this.sounds_.toggle());
    for (const gesture of ['pointerup', 'keydown', 'click'] as const) {
      window.addEventListener(gesture, (event) => this.touched(event), { capture: true });
    }
    document.addEventListener('visibilitychange', () => this.sounds_.hide(document.hidden));
    this.update();
  }

  show_tours(scene_id: string, tours: readonly Tour[]): void {
    const { value: token, pass } = this.token_;
    // Sounds begin again at another address, so an author's edit does not change it.
    const addresses_for = `${scene_id} ${token} ${pass !== ''}`;
    if (this.addresses_for_ !== addresses_for)
      this.addresses_ = new MediaAddresses(location.href, this.token_, scene_id);
    this.addresses_for_ = addresses_for;
    const sounds = ({ sound, stops }: Tour): boolean =>
      sound !== undefined ||
      stops.some(
        ({ media, narration }) => narration ?? media?.some(({ kind }) => kind !== 'image'),
      );
    this.button_.hidden = !tours.some(sounds);
    this.tour_ = undefined;
  }

  show({ tour, stop, playing }: TourState): void {
    if (tour !== this.tour_) void this.use_sound_of(tour);
    const pauses = this.playing_ && !playing;
    this.playing_ = playing;
    if (stop === this.stop_) {
      if (pauses && this.sounds_.voice === 'speaks') this.sounds_.hush(true);
      return;
    }
    this.stop_ = stop;
    this.media_.show(stop?.media ?? [], this.addresses_);
    this.narrator_.show(stop?.narration, this.addresses_);
  }

  /** The visitor has come to the stop that is shown. */
  arrived(): void {
    void this.narrator_.speak();
  }

  when_heard(then: () => void): () => void {
    return this.sounds_.when_heard(then);
  }

  private async use_sound_of(tour: Tour | undefined): Promise<void> {
    this.tour_ = tour;
    const { sound } = tour ?? {};
    const address = sound ? await this.addresses_.of(sound.src) : '';
    if (tour === this.tour_) this.sounds_.set_background(address, sound?.volume ?? 0);
  }

  /** The buttons of sounds answer to their own clicks. */
  private touched({ target }: Event): void {
    if (!(target instanceof Element && target.closest('#button-sound, #tour-voice')))
      this.sounds_.touch();
  }

  private update(): void {
    const { audible, muted } = this.sounds_;
    const label = audible ? text.media.mute : text.media.sound_on;
    this.button_.setAttribute('aria-label', label);
    this.button_.title = label;
    this.button_
      .querySelector('use')
      ?.setAttribute('href', audible ? '#icon-sound' : '#icon-muted');
    this.media_.mute(muted);
    this.narrator_.update();
  }
}
