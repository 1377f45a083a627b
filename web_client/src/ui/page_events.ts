import { has_token, watch_token } from '../session/token';
import type { WorkerClient } from '../worker/client';

/**
 * Tells the worker when the page is hidden, is online again, or is left. Browsers keep pages that are left, and show
 * them again: meanwhile such a page has no visit. A link with a token that is opened
 * in this tab changes no more than the fragment, and the page begins anew with it.
 */
export function bind_page_events(worker: WorkerClient): void {
  let waits = false;
  worker.on('state', ({ state }) => {
    waits = state.phase === 'waiting';
  });
  const look = (): void => worker.post({ kind: 'hidden', hidden: document.hidden });
  document.addEventListener('visibilitychange', look);
  if (document.hidden) look();
  window.addEventListener('online', () => {
    if (waits) worker.post({ kind: 'retry' });
  });
  const watched = watch_token(location.href);
  window.addEventListener('hashchange', () => {
    const other = watch_token(location.href);
    if (has_token(location.href) || (other && other !== watched)) location.reload();
  });
  window.addEventListener('pagehide', () => worker.post({ kind: 'leave' }));
  window.addEventListener('pageshow', ({ persisted }) => {
    if (persisted) worker.post({ kind: 'come_back' });
  });
}
