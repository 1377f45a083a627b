import { CardView } from './ui/card';
import type { SessionStatus } from './ui/session_status';
import { mount_viewer } from './ui/viewer';
import { broken_card, unsupported_card } from './ui/wording';

function main(): void {
  const card = new CardView();
  let status: SessionStatus | undefined;
  const broken = (message: string): void => {
    if (status) status.break_off(message);
    else card.show(broken_card(message));
  };
  window.addEventListener('error', (event) => {
    // This is no error: a size changed twice within one frame, and the next frame reports it.
    if (!event.message.startsWith('ResizeObserver loop')) broken(event.message);
  });
  window.addEventListener('unhandledrejection', (event) => broken(String(event.reason)));

  const unsupported = unsupported_card(globalThis);
  if (unsupported) card.show(unsupported);
  else status = mount_viewer(card);
}

main();
