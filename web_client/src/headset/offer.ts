// Offers to enter a headset where the browser has one. All else of it loads when somebody does.
import { load_part } from '../base/load_part';
import { by_id } from '../page/dom';
import { text } from '../text/text';
import type { Headset, HeadsetParts } from './headset';

export function offer_headset(parts: HeadsetParts): void {
  const { xr } = navigator as { readonly xr?: XRSystem };
  if (!xr) return;
  const button = by_id('button-headset', HTMLButtonElement);
  const look = async (): Promise<void> => {
    const is_there = await xr.isSessionSupported('immersive-vr').catch(() => false);
    button.hidden = !is_there;
  };
  xr.addEventListener('devicechange', () => void look());
  void look();
  let headset: Headset | undefined;
  button.addEventListener('click', () => {
    // At once: browsers allow it for a moment after the press.
    const asked = xr.requestSession('immersive-vr', {
      optionalFeatures: ['local-floor', 'hand-tracking'],
    });
    Promise.all([asked, load_part(() => import('./headset'))])
      .then(([session, { Headset }]) => (headset ??= new Headset(parts)).enter(session))
      .catch((error: unknown) => {
        console.warn('no headset', error);
        parts.notice.show(text.headset.refused, 10);
        asked.then((session) => session.end()).catch(() => undefined); // where it has begun
      });
  });
}
