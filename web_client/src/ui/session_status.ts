import type { Notice } from '../page/notice';
import type { Toolbar } from '../page/toolbar';
import { list_scenes, type SceneListing } from '../session/scenes';
import type { SessionState } from '../session/state';
import type { AccessToken } from '../session/token';
import { Error_Code } from '../wire/wire';
import type { WorkerClient } from '../worker/client';
import type { CardView } from './card';
import { broken_card, card_for, failure_note } from './wording';

const first_card_after_ms = 300; // a fast connection shows its picture without a flash of cards

/** Shows the state of the session on the card, and passes on the visitor's answers. */
export class SessionStatus {
  private state_: SessionState = { phase: 'connecting', attempt: 0 };
  private has_picture_ = false;
  private scenes_: readonly SceneListing[] = [];
  private broken_ = false;
  private told_ = false;

  constructor(
    private readonly card_: CardView,
    private readonly notice_: Notice,
    private readonly toolbar_: Toolbar,
    private readonly worker_: WorkerClient,
    private readonly token_: AccessToken,
  ) {
    worker_.on('state', ({ state }) => this.changed(state));
    worker_.on('presented', () => {
      if (this.has_picture_) return;
      this.has_picture_ = true;
      this.show();
    });
    worker_.on('error', ({ message }) => this.failed(message));
    worker_.on('broken', ({ message }) => this.break_off(message));
    card_.retried.listen(() => worker_.post({ kind: 'retry' }));
    card_.token_given.listen((token) => {
      if (token) token_.value = token;
      else token_.set_aside();
      worker_.post({ kind: 'token', token });
    });
    setTimeout(() => this.show(), first_card_after_ms);
  }

  /** Something in the page failed. Without a picture the page cannot go on. */
  failed(message: string): void {
    if (!this.has_picture_) return this.break_off(message);
    if (!this.told_) this.notice_.show(failure_note(message));
    this.told_ = true; // it may fail in every frame
  }

  /** Ends the session for good. The card with the error stays. */
  private break_off(message: string): void {
    this.broken_ = true;
    this.worker_.post({ kind: 'stop' });
    this.toolbar_.set_active(false);
    this.card_.show(broken_card(message));
  }

  private changed(state: SessionState): void {
    this.state_ = state;
    if (state.phase !== 'connecting' || state.attempt > 0) this.show();
    if (state.phase === 'failed' && state.code === Error_Code.UNKNOWN_SCENE)
      void this.offer_scenes();
  }

  private show(): void {
    if (this.broken_) return;
    this.card_.show(
      card_for(this.state_, this.has_picture_, this.scenes_, this.token_.value !== ''),
    );
    this.toolbar_.set_active(this.state_.phase !== 'failed');
    document.body.classList.toggle('stale', this.has_picture_ && this.state_.phase !== 'live');
  }

  /** Asks for the list of scenes, because no welcome has brought it. */
  private async offer_scenes(): Promise<void> {
    this.scenes_ = await list_scenes(location.href, this.token_.value);
    this.show();
  }
}
