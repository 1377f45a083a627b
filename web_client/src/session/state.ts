import type { Error_Code } from '../wire/wire';

/** State of the session, for the page to show. */
export type SessionState =
  | { phase: 'connecting'; attempt: number }
  | { phase: 'queued'; position: number; estimate_s: number; for_scene: boolean }
  | { phase: 'live' }
  /** The session tries again by itself. */
  | { phase: 'waiting'; cause: WaitCause; retry_in_ms: number; message: string }
  /** The session stays so until retry() or greet_anew(). */
  | { phase: 'failed'; code: Error_Code; message: string };

export type WaitCause =
  | 'unreachable' // no connection could be opened
  | 'updating' // the server ends, and another takes its place
  | 'lost' // an open connection was closed
  | 'silent' // an open connection said nothing for too long
  | 'no_host' // this page watches, and nobody presents now
  | 'refused'; // the server said why, and trying again makes sense
