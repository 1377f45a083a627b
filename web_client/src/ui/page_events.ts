import type { WorkerClient } from '../worker/client';

/** Tells the worker when the page is hidden, is online again, or closes. */
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
  window.addEventListener('pagehide', (event) => {
    if (!event.persisted) worker.post({ kind: 'stop' });
  });
}
