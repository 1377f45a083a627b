import { Signal } from '../base/signal';
import { by_id, make } from '../page/dom';
import { scene_address, scene_labels, type SceneListing } from '../session/scenes';
import type { Card } from './wording';

/** The card over the picture: what is going on while no picture says it. */
export class CardView {
  readonly retried = new Signal();
  readonly token_given = new Signal<string>();
  /** The visitor wants to be called when it is their turn. */
  readonly call_wanted = new Signal();
  private readonly card_ = by_id('card', HTMLElement);
  private readonly title_ = by_id('card-title', HTMLElement);
  private readonly text_ = by_id('card-text', HTMLElement);
  private readonly action_ = by_id('card-action', HTMLButtonElement);
  private readonly form_ = by_id('token-form', HTMLFormElement);
  private readonly token_ = by_id('token-input', HTMLInputElement);
  private shown_: Card | undefined;
  private will_call_ = false;

  constructor() {
    this.action_.addEventListener('click', () => {
      const action = this.shown_?.action;
      if (action?.does === 'reload') location.reload();
      else if (action?.does === 'open')
        location.href = scene_address(location.href, action.scene_id);
      else if (action?.does === 'call') this.promise_call();
      else if (action?.does === 'look') this.token_given.emit('');
      else this.retried.emit();
    });
    this.form_.addEventListener('submit', (event) => {
      event.preventDefault();
      const token = this.token_.value.trim();
      this.token_.value = '';
      if (token) this.token_given.emit(token);
    });
  }

  show(card: Card | undefined): void {
    this.shown_ = card;
    this.card_.hidden = card === undefined;
    if (!card) return;
    this.card_.classList.toggle('settled', card.busy !== true);
    // Screen readers read what changes.
    if (this.title_.textContent !== card.title) this.title_.textContent = card.title;
    if (this.text_.textContent !== card.text) this.text_.textContent = card.text;
    by_id('card-time', HTMLElement).textContent = card.time ?? '';
    by_id('card-stays', HTMLElement).hidden = true;
    show_links(by_id('card-scenes', HTMLUListElement), card.scenes ?? []);
    this.form_.hidden = card.asks_token !== true;
    this.action_.hidden =
      card.action === undefined || (card.action.does === 'call' && this.will_call_);
    this.action_.textContent = card.action?.label ?? '';
  }

  /** The visitor was called and may ask for it again. */
  call_over(): void {
    this.will_call_ = false;
  }

  private promise_call(): void {
    this.will_call_ = true;
    this.action_.hidden = true;
    this.call_wanted.emit();
  }
}

function show_links(list: HTMLElement, scenes: readonly SceneListing[]): void {
  list.hidden = scenes.length === 0;
  const labels = scene_labels(scenes);
  list.replaceChildren(
    ...scenes.map(({ id }, i) =>
      make(
        'li',
        {},
        make('a', { dir: 'auto', href: scene_address(location.href, id) }, labels[i] ?? id),
      ),
    ),
  );
}
