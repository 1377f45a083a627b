// Offers to enter a headset where the browser has one. All else of it loads when somebody does.
import { load_part } from '../base/load_part';
import { by_id, make } from '../page/dom';
import { text } from '../text/text';
import type { Headset, HeadsetParts } from './headset';

const look_again_ms = 10_000;

type WithXr = Navigator & { readonly xr?: XRSystem };
type WithPolicy = Document & { readonly featurePolicy?: { allowsFeature(name: string): boolean } };

/** Whether the page around this one allows it. To ask all the same would be an error of the page. */
const is_allowed = (): boolean =>
  (document as WithPolicy).featurePolicy?.allowsFeature('xr-spatial-tracking') ?? true;

/**
 * Asks in a frame that goes again: browsers keep no page for the way back that has looked at navigator.xr.
 */
async function has_headset(): Promise<boolean> {
  const frame = make('iframe', { hidden: true });
  document.body.append(frame);
  try {
    const { xr } = frame.contentWindow?.navigator as WithXr;
    return (await xr?.isSessionSupported('immersive-vr')) ?? false;
  } catch {
    return false; // browsers without featurePolicy: the page around this one does not allow it
  } finally {
    frame.remove();
  }
}

export function offer_headset(parts: HeadsetParts): void {
  if (!('xr' in navigator) || !is_allowed()) return;
  const button = by_id('button-headset', HTMLButtonElement);
  let looked_ms = -Infinity;
  const look = async (): Promise<void> => {
    const now_ms = performance.now();
    if (now_ms - looked_ms < look_again_ms) return;
    looked_ms = now_ms;
    button.hidden = !(await has_headset());
  };
  void look();
  window.addEventListener('focus', () => void look()); // somebody may have connected one
  let headset: Headset | undefined;
  button.addEventListener('click', () => {
    // At once: browsers allow it for a moment after the press.
    const asked = navigator.xr!.requestSession('immersive-vr', {
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
