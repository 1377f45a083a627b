// What the page says in each situation: what happened and what to do. Pure.
import type { DecoderRung } from '../decode/ladder';
import type { SessionState } from '../session/state';
import { Error_Code } from '../wire/wire';

export interface Card {
  readonly title: string;
  readonly text: string;
  readonly busy?: boolean; // something goes on by itself
  readonly action?: {
    readonly label: string;
    readonly does: 'retry' | 'reload' | 'open';
    /** What 'open' opens: this scene; empty: the first one. */
    readonly scene_id?: string;
  };
  readonly asks_token?: boolean;
  readonly scene_ids?: readonly string[]; // to choose from
}

/**
 * Undefined when the picture speaks for itself. `has_picture`: one is on the canvas. `scene_ids`:
 * what this visitor may see, as far as known.
 */
export function card_for(
  state: SessionState,
  has_picture: boolean,
  scene_ids: readonly string[] = [],
): Card | undefined {
  switch (state.phase) {
    case 'live':
      return has_picture
        ? undefined
        : { title: 'Connected', text: 'Waiting for the first picture.', busy: true };
    case 'connecting':
      return { title: has_picture ? 'Reconnecting' : 'Connecting', text: '', busy: true };
    case 'queued':
      if (state.for_scene)
        return {
          title: 'Loading the scene',
          text: `It is not in the server's memory yet. That takes about ${duration(state.estimate_s)}.`,
          busy: true,
        };
      return {
        title: `Number ${state.position} in the queue`,
        text: `The server is full. Your turn comes in about ${duration(state.estimate_s)}; leave this page open.`,
        busy: true,
      };
    case 'waiting':
      return {
        title: waiting_title[state.cause],
        text: `${sentence(state.message)}Trying again in ${duration(state.retry_in_ms / 1000)}.`,
        busy: true,
        action: { label: 'Try now', does: 'retry' },
      };
    case 'failed':
      return failed_card(state.code, state.message, scene_ids);
  }
}

const waiting_title = {
  unreachable: 'The server does not answer',
  lost: 'Connection lost',
  silent: 'The server has gone silent',
  refused: 'The server is busy',
} as const;

function failed_card(code: Error_Code, message: string, scene_ids: readonly string[]): Card {
  const retry = { label: 'Try again', does: 'retry' } as const;
  const reload = { label: 'Reload', does: 'reload' } as const;
  switch (code) {
    case Error_Code.UNAUTHORIZED:
      return {
        title: 'Access token needed',
        text: sentence(message).trim(),
        asks_token: true,
      };
    case Error_Code.UNKNOWN_SCENE:
      return {
        title: 'No such scene',
        text:
          sentence(message) +
          (scene_ids.length > 1
            ? 'These are here:'
            : "Check the scene's name in the address (?scene=…)."),
        scene_ids: scene_ids.length > 1 ? scene_ids : [],
        action:
          scene_ids[0] === undefined
            ? { label: 'Open the first scene', does: 'open', scene_id: '' }
            : { label: `Open ${scene_ids[0]}`, does: 'open', scene_id: scene_ids[0] },
      };
    case Error_Code.UNSUPPORTED_VERSION:
      return {
        title: 'Page and server do not fit together',
        text: `${sentence(message)}The server was updated: reload this page.`,
        action: reload,
      };
    case Error_Code.NO_COMMON_CODEC:
      return {
        title: 'No common video format',
        text: `${sentence(message)}Try a current Chrome, Edge, Firefox or Safari.`,
        action: retry,
      };
    case Error_Code.IDLE_TIMEOUT:
      return {
        title: 'Paused',
        text: `${sentence(message)}Your place was given to others; continue where you were.`,
        action: { label: 'Continue', does: 'retry' },
      };
    case Error_Code.RENDER_FAILED:
      return {
        title: 'The server could not render the scene',
        text: `${sentence(message)}Its log says more.`,
        action: retry,
      };
    default:
      return { title: 'The server refused the session', text: sentence(message), action: retry };
  }
}

/** Something in the page itself went wrong. */
export function broken_card(message: string): Card {
  return {
    title: 'This page ran into an error',
    text: `${sentence(message)}Reload it; if that does not help, please report the message.`,
    action: { label: 'Reload', does: 'reload' },
  };
}

/** What the browser lacks to show anything at all; undefined when it is good enough. */
export function unsupported_card(
  scope: Partial<Pick<typeof globalThis, 'Worker' | 'OffscreenCanvas' | 'WebSocket'>>,
): Card | undefined {
  const lacking = (['Worker', 'OffscreenCanvas', 'WebSocket'] as const).filter((f) => !scope[f]);
  if (lacking.length === 0) return undefined;
  return {
    title: 'This browser is too old',
    text: `It lacks ${lacking.join(' and ')}. Chrome 94, Edge 94, Firefox 113 and Safari 16.4 or newer work.`,
  };
}

/** Why pictures come as JPEG although the server may have video; undefined when they do not. */
export function jpeg_reason(
  has_webcodecs: boolean,
  is_secure: boolean,
  rung: DecoderRung,
): string | undefined {
  if (has_webcodecs) {
    return rung === 'jpeg'
      ? 'Video could not be decoded here lately: pictures come as JPEG, which needs more bandwidth. Video is tried again in a week, or after the site data of this page is cleared.'
      : undefined;
  }
  return is_secure
    ? 'This browser has no video decoder for pages (WebCodecs): pictures come as JPEG, which needs more bandwidth. A current Chrome, Edge, Firefox or Safari gets video.'
    : 'Pictures come as JPEG: browsers offer their video decoder (WebCodecs) on https:// and localhost only. Serve this page with TLS to get video, which needs far less bandwidth.';
}

function sentence(text: string): string {
  const trimmed = text.trim();
  if (trimmed === '') return '';
  const capital = trimmed.charAt(0).toUpperCase() + trimmed.slice(1);
  return /[.!?]$/.test(capital) ? `${capital} ` : `${capital}. `;
}

function duration(seconds: number): string {
  if (seconds < 1) return 'a moment';
  if (seconds < 90) return `${Math.round(seconds)} s`;
  return `${Math.round(seconds / 60)} min`;
}
