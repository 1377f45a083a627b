import { has_token, watch_token } from '../session/token';
import type { WorkerClient } from '../worker/client';

/**
 * Tells the worker when the page is hidden, is online again, or closes. A link with a token that is opened
 * in this tab changes no more than the fragment, and the page begins anew with it.
 */
export function bind_page_events(worker: WorkerClient): void {
  let waits = false;
  worker.on('state', ({ state }) => {
    waits = state.phase === 'waiting';
  });
  document.addEventListener('visibilitychange', () => {
    worker.post({ kind: 'hidden', hidden: document.hidden });
  });
  window.addEventListener('online', () => {
    if (waits) worker.post({ kind: 'retry' });
  });
  const watched = watch_token(location.href);
  window.addEventListener('hashchange', () => {
    const other = watch_token(location.href);
    if (has_token(location.href) || (other && other !== watched)) location.reload();
  });
  window.addEventListener('pagehide', (event) => {
    if (!event.persisted) worker.post({ kind: 'stop' });
  });
}
