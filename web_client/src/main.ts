import { broken_card, unsupported_card } from './ui/wording';
import { CardView } from './ui/card';
import { Viewer } from './ui/viewer';

function main(): void {
  const card = new CardView({
    retry: () => viewer?.retry(),
    token: (token) => viewer?.use_token(token),
  });
  const broken = (message: string): void => {
    if (viewer) viewer.break_off(message);
    else card.show(broken_card(message));
  };
  let viewer: Viewer | undefined;
  window.addEventListener('error', (event) => {
    // Not an error: a size changed again within one frame, and is reported in the next.
    if (!event.message.startsWith('ResizeObserver loop')) broken(event.message);
  });
  window.addEventListener('unhandledrejection', (event) => broken(String(event.reason)));

  const unsupported = unsupported_card(globalThis);
  if (unsupported) card.show(unsupported);
  else viewer = new Viewer(card);
}

main();
