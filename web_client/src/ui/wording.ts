// Chooses the text for each situation: what happened, and what to do. Pure.
import type { DecoderRung } from '../decode/ladder';
import type { SceneListing } from '../session/scenes';
import type { SessionState } from '../session/state';
import { duration, list } from '../text/number';
import { text } from '../text/text';
import { Error_Code } from '../wire/wire';

const { cards, actions } = text;

export interface Card {
  readonly title: string;
  readonly text: string;
  readonly time?: string; // how long it takes: it changes all the time, so it is not read out
  readonly busy?: boolean; // the page continues by itself
  readonly action?: {
    readonly label: string;
    readonly does: 'retry' | 'reload' | 'open' | 'call' | 'look';
    /** The scene that 'open' opens; empty: the first one. */
    readonly scene_id?: string;
  };
  readonly asks_token?: boolean;
  readonly scenes?: readonly SceneListing[]; // to choose from
}

/**
 * The card for a state; undefined when the picture speaks for itself. `has_picture`: whether the canvas
 * shows one. `scenes`: those that this visitor may see, as far as known. `has_token`: this visitor has a
 * token, and the server may be open to those without one.
 */
export function card_for(
  state: SessionState,
  has_picture: boolean,
  scenes: readonly SceneListing[] = [],
  has_token = false,
): Card | undefined {
  switch (state.phase) {
    case 'live':
      return has_picture ? undefined : { ...cards.no_picture, busy: true };
    case 'connecting':
      return { title: has_picture ? cards.reconnecting : cards.connecting, text: '', busy: true };
    case 'queued': {
      const time = duration(state.estimate_s);
      const { loading_scene, queue } = cards;
      return state.for_scene
        ? {
            title: loading_scene.title,
            text: loading_scene.text,
            time: loading_scene.time({ time }),
            busy: true,
          }
        : {
            title: queue.title({ position: state.position }),
            text: queue.text,
            time: queue.time({ time }),
            busy: true,
            action: { label: actions.call, does: 'call' },
          };
    }
    case 'waiting':
      if (state.cause === 'no_host') {
        return {
          title: cards.waiting.no_host,
          text: text.shared_tour.appears_by_itself,
          busy: true,
        };
      }
      return {
        title: cards.waiting[state.cause],
        text: sentence(state.message).trim(),
        time: cards.trying_again({ time: duration(state.retry_in_ms / 1000) }),
        busy: true,
        action: { label: actions.now, does: 'retry' },
      };
    case 'failed':
      return failed_card(state.code, state.message, scenes, has_token);
  }
}

function failed_card(
  code: Error_Code,
  message: string,
  scenes: readonly SceneListing[],
  has_token: boolean,
): Card {
  const retry = { label: actions.retry, does: 'retry' } as const;
  const said = ({ title, text }: { title: string; text: string }): Card => ({
    title,
    text: sentence(message) + text,
    action: retry,
  });
  switch (code) {
    case Error_Code.UNAUTHORIZED:
      return {
        title: cards.unauthorized,
        text: sentence(message).trim(),
        asks_token: true,
        ...(has_token && { action: { label: actions.look, does: 'look' } }),
      };
    case Error_Code.UNKNOWN_SCENE:
      return unknown_scene_card(message, scenes);
    case Error_Code.UNSUPPORTED_VERSION:
      return { ...said(cards.version), action: { label: actions.reload, does: 'reload' } };
    case Error_Code.NO_COMMON_CODEC:
      return said(cards.no_codec);
    case Error_Code.IDLE_TIMEOUT:
      return { ...said(cards.idle), action: { label: actions.resume, does: 'retry' } };
    case Error_Code.RENDER_FAILED:
      return said(cards.render_failed);
    default:
      return { title: cards.refused, text: sentence(message), action: retry };
  }
}

function unknown_scene_card(message: string, scenes: readonly SceneListing[]): Card {
  const { title, others, check } = cards.unknown_scene;
  const [first] = scenes;
  if (scenes.length > 1) return { title, text: sentence(message) + others, scenes };
  return {
    title,
    text: sentence(message) + check,
    action: {
      label: first === undefined ? actions.open_first : actions.open({ scene_id: first.title }),
      does: 'open',
      scene_id: first?.id ?? '',
    },
  };
}

/** The card for an error in the page itself. */
export function broken_card(message: string): Card {
  return {
    title: cards.broken.title,
    text: sentence(message) + cards.broken.text,
    action: { label: actions.reload, does: 'reload' },
  };
}

/** The same for an error that the page survives. */
export const failure_note = (message: string): string =>
  sentence(cards.broken.title) + sentence(message) + cards.broken.text;

/** The card that names what the browser lacks; undefined when it lacks nothing. */
export function unsupported_card(
  scope: Partial<Pick<typeof globalThis, 'Worker' | 'OffscreenCanvas' | 'WebSocket'>>,
): Card | undefined {
  const lacking = (['Worker', 'OffscreenCanvas', 'WebSocket'] as const).filter((f) => !scope[f]);
  if (lacking.length === 0) return undefined;
  const { title, text } = cards.unsupported;
  return { title, text: text({ lacking: list(lacking) }) };
}

/** Why pictures come as JPEG and not as video, as a key of the console's texts; undefined when they come as video. */
export function jpeg_reason(
  has_webcodecs: boolean,
  is_secure: boolean,
  rung: DecoderRung,
): 'failed_recently' | 'no_decoder' | 'not_secure' | undefined {
  if (has_webcodecs) return rung === 'jpeg' ? 'failed_recently' : undefined;
  return is_secure ? 'no_decoder' : 'not_secure';
}

function sentence(said: string): string {
  const trimmed = said.trim();
  if (trimmed === '') return '';
  const capital = trimmed.charAt(0).toUpperCase() + trimmed.slice(1);
  return /[.!?。！？؟]$/.test(capital) ? `${capital} ` : `${capital}. `;
}
