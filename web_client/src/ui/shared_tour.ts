// A shared tour: participants see what its host sees. They watch the host's own pictures, or follow the host's
// camera on a stream of their own, if the server has a slot for them.
import { Signal } from '../base/signal';
import type { Eye } from '../camera/eye';
import { glide, glide_time_s, pursuit } from '../camera/flight';
import { by_id, on_click } from '../page/dom';
import type { PageParts } from '../page/parts';
import { watch_token } from '../session/token';
import { text } from '../text/text';
import { presentation_address } from '../tour/share';
import { Lead_State, type Lead, type Welcome } from '../wire/wire';
import type { ShownStop } from '../worker/messages';
import type { Pointing } from './pointing';

const { shared_tour: words } = text;
const most_name_bytes = 64; // that the wire takes

/**
 * alone: there is no presentation, or it is over. watching: the pictures are the host's. following: the
 * camera is. left: the visitor looks around and may follow again. presenting: this visitor is the host.
 */
type Role = 'alone' | 'watching' | 'following' | 'left' | 'presenting';

export class SharedTour {
  /** The visitor takes part no more. */
  readonly left = new Signal();
  readonly takes_part = new Signal<boolean>();
  /** To participants: what their host sees. */
  readonly shown = new Signal<ShownStop>();
  private role_: Role = 'alone';
  private lead_: Lead | undefined;
  private host_eye_: Eye | undefined;
  private may_leave_ = false;
  private host_gone_ = false; // a card says so
  private joining_ = false; // on the way from the visitor's own view to the host's
  private chasing_ = false; // this part replaces its own flight by the next
  private readonly token_ = watch_token(location.href);
  private wants_ = this.token_ !== ''; // to follow; cameras that were sent before the visitor left still arrive
  private readonly bar_ = by_id('shared-tour', HTMLElement);
  private readonly action_ = by_id('shared-tour-action', HTMLButtonElement);
  private readonly view_ = by_id('view', HTMLElement);
  private readonly own_label_ = this.view_.getAttribute('aria-label') ?? '';
  private readonly name_ = by_id('present-name', HTMLInputElement);
  private readonly link_ = by_id('present-link', HTMLInputElement);
  private readonly pings_ = by_id('present-pings', HTMLInputElement);
  private readonly places_ = by_id('present-positions', HTMLInputElement);

  constructor(
    private readonly parts_: Pick<
      PageParts,
      'worker' | 'navigation' | 'toolbar' | 'notice' | 'reduced_motion'
    >,
    private readonly pointing_: Pointing,
  ) {
    const { worker, navigation } = parts_;
    navigation.led = this.token_ !== '';
    worker.on('welcome', ({ welcome }) => this.welcomed(welcome));
    worker.on('state', ({ state }) => {
      this.host_gone_ = state.phase === 'waiting' && state.cause === 'no_host';
      this.show();
    });
    worker.on('lead', ({ lead, eye }) => this.heard(lead, eye));
    worker.on('presented', ({ eye }) => {
      if (this.role_ !== 'watching') return;
      this.host_eye_ = eye;
    });
    navigation.entered.listen(() => {
      // A visitor who watched continues from the host's view.
      if (this.role_ === 'watching' && this.host_eye_) navigation.put(this.host_eye_);
    });
    navigation.taken_over.listen(() => {
      if (this.role_ === 'following') this.leave();
    });
    this.action_.addEventListener('click', () => this.act());
    on_click('present-start', () => this.present());
    on_click('present-stop', () => this.stop());
    for (const box of [this.pings_, this.places_]) {
      box.addEventListener('change', () => {
        if (this.role_ === 'presenting') this.tell_present();
      });
    }
    on_click('present-copy', () => void this.copy());
    this.link_.addEventListener('focus', () => this.link_.select());
  }

  private welcomed({ watching, mayLeave, watchToken, scene }: Welcome): void {
    this.may_leave_ = mayLeave;
    by_id('present', HTMLElement).hidden = watchToken === '' || this.token_ !== '';
    this.link_.value = presentation_address(location.href, scene?.sceneId ?? '', watchToken);
    if (watching) this.become('watching');
    else if (this.role_ === 'watching') this.become('left'); // it comes to follow by the next message
  }

  private heard(lead: Lead, eye: Eye | undefined): void {
    const before = this.lead_;
    this.lead_ = lead;
    if (eye) this.host_eye_ = eye;
    if (this.role_ === 'presenting' || this.role_ === 'watching') this.show();
    else if (lead.state === Lead_State.ENDED) {
      if (!lead.elsewhere) this.ended();
      else if (this.wants_) this.go_along();
    } else if (eye && this.wants_) this.follow(eye);
    if (this.role_ === 'following' && differ(before, lead)) this.show();
    if (this.role_ === 'following' || this.role_ === 'watching')
      this.shown.emit(stop_of(lead.shown));
  }

  /** A later presentation does not bring the visitor back. */
  private ended(): void {
    this.wants_ = false;
    this.parts_.worker.post({ kind: 'follow', watch: '' });
    if (this.role_ === 'following') this.parts_.notice.show(words.over, 10);
    this.become(this.role_ === 'following' ? 'alone' : 'left'); // who asks too early may ask again
    this.parts_.navigation.stop_flight();
  }

  /** The host is in another scene. Starts again there, or watches where the visitor may not go. */
  private go_along(): void {
    this.parts_.notice.show(words.moved({ name: this.lead_?.name || words.host }), 10);
    this.become('left'); // it comes to follow by the next message
    this.parts_.navigation.stop_flight();
    this.parts_.worker.post({ kind: 'watch', watch: this.token_ });
  }

  private follow(eye: Eye): void {
    if (this.role_ !== 'following') {
      this.become('following');
      this.joining_ = true;
      const from = this.parts_.navigation.eye;
      const time_s = this.parts_.reduced_motion
        ? 0
        : glide_time_s(from, eye, this.parts_.navigation.reach);
      this.fly(glide(from, eye, time_s));
    } else if (!this.joining_) {
      this.chase();
    }
  }

  private chase(): void {
    const {
      host_eye_: to,
      parts_: { navigation },
    } = this;
    if (to) this.fly(this.parts_.reduced_motion ? glide(to, to, 0) : pursuit(navigation.eye, to));
  }

  private fly(way: ReturnType<typeof glide>): void {
    this.chasing_ = true;
    this.parts_.navigation.fly(way, (arrived) => {
      if (arrived && this.joining_) {
        this.joining_ = false;
        this.chase();
      } else if (!arrived && !this.chasing_ && this.role_ === 'following') {
        this.leave(); // a tour or a gesture has taken the camera
      }
    });
    this.chasing_ = false;
  }

  private act(): void {
    if (this.role_ === 'presenting') this.stop();
    else if (this.role_ === 'left') this.come_back();
    else if (this.role_ === 'watching') this.parts_.worker.post({ kind: 'watch', watch: '' });
    else this.leave();
  }

  private come_back(): void {
    this.wants_ = true;
    this.parts_.worker.post({ kind: 'follow', watch: this.token_ });
  }

  private leave(): void {
    this.wants_ = false;
    this.parts_.worker.post({ kind: 'follow', watch: '' });
    this.become('left');
    this.parts_.navigation.stop_flight();
  }

  private tell_present(): void {
    const name = within_bytes(this.name_.value.trim());
    const allowed = { pings: this.pings_.checked, tells_positions: this.places_.checked };
    this.parts_.worker.post({ kind: 'present', on: true, name, ...allowed });
  }

  private present(): void {
    this.tell_present();
    this.lead_ = undefined;
    this.become('presenting');
    by_id('present-copy', HTMLButtonElement).focus();
  }

  private stop(): void {
    this.parts_.worker.post({
      kind: 'present',
      on: false,
      name: '',
      pings: false,
      tells_positions: false,
    });
    this.become('alone');
  }

  private async copy(): Promise<void> {
    const clipboard = navigator.clipboard as Clipboard | undefined;
    let said: string = text.share.copy_yourself;
    try {
      if (clipboard) {
        await clipboard.writeText(this.link_.value);
        said = words.copied;
      }
    } catch {
      this.link_.select();
    }
    by_id('present-done', HTMLOutputElement).textContent = said;
  }

  private become(role: Role): void {
    this.role_ = role;
    const is_out = role === 'alone' || role === 'left';
    if (is_out) this.left.emit();
    this.takes_part.emit(!is_out);
    const watching = role === 'watching';
    document.body.classList.toggle('watching', watching);
    by_id('hotspots', HTMLElement).inert = watching;
    this.parts_.toolbar.watching = watching;
    this.view_.setAttribute('role', watching ? 'img' : 'application');
    const presenting = role === 'presenting';
    for (const id of ['present-link', 'present-copy', 'present-stop'])
      by_id(id, HTMLElement).hidden = !presenting;
    for (const id of ['present-name', 'present-start']) by_id(id, HTMLElement).hidden = presenting;
    by_id('present-done', HTMLOutputElement).textContent = '';
    this.show();
  }

  private show(): void {
    const name = this.lead_?.name || words.host;
    const count = this.lead_?.company ?? 0;
    const away = this.lead_?.state === Lead_State.AWAY;
    const presents = count > 1 ? words.presents_to({ name, count }) : words.presents({ name });
    const said: Readonly<Record<Role, string>> = {
      alone: '',
      watching: this.host_gone_ ? '' : away ? words.away({ name }) : presents,
      following: away ? words.away({ name }) : presents,
      left: '', // the server does not tell those who left whether the host still presents
      presenting: words.you_present({ count }),
    };
    const action: Readonly<Record<Role, string>> = {
      alone: '',
      watching: this.may_leave_ ? words.leave : '',
      following: words.leave,
      left: this.lead_?.name ? words.follow({ name }) : words.follow_host,
      presenting: words.stop,
    };
    this.pointing_.allowed =
      this.role_ === 'presenting' || (this.role_ === 'following' && this.lead_?.mayPing === true);
    const line = by_id('shared-tour-text', HTMLElement);
    if (line.textContent !== said[this.role_]) line.textContent = said[this.role_];
    this.bar_.hidden = said[this.role_] === '' && action[this.role_] === '';
    this.action_.textContent = action[this.role_];
    this.action_.hidden = action[this.role_] === '';
    this.view_.setAttribute(
      'aria-label',
      this.role_ === 'watching' ? words.view({ name }) : this.own_label_,
    );
  }
}

/** Numbers on the wire count from 1. Undefined: the host sees nothing of the tours. */
const stop_of = (shown: Lead['shown']): ShownStop => ({
  tour_index: shown?.tour ? shown.tour - 1 : undefined,
  stop_index: shown?.stop ? shown.stop - 1 : undefined,
  arrived: shown?.arrived ?? false,
});

/** Whether more than the camera is new. */
const differ = (a: Lead | undefined, b: Lead): boolean =>
  a?.state !== b.state || a.name !== b.name || a.company !== b.company || a.mayPing !== b.mayPing;

/** As much of the name as the wire takes. */
function within_bytes(name: string): string {
  let short = Array.from(name);
  while (new TextEncoder().encode(short.join('')).length > most_name_bytes)
    short = short.slice(0, -1);
  return short.join('');
}
