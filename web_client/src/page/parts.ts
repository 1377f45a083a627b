// The parts of the page that its larger features share.
import { browser_storage, type KeptTexts } from '../base/browser_storage';
import { clock_from, type Clock } from '../base/clock';
import { ScrollGate } from '../input/scroll_gate';
import type { AccessToken } from '../session/token';
import { text } from '../text/text';
import { WorkerClient } from '../worker/client';
import { Clipping } from './clipping';
import { by_id } from './dom';
import { Navigation } from './navigation';
import { Notice } from './notice';
import { SeenCamera } from './seen_camera';
import { Toolbar } from './toolbar';

export interface PageParts {
  readonly view: HTMLElement;
  readonly clock: Clock;
  readonly worker: WorkerClient;
  readonly navigation: Navigation;
  readonly clipping: Clipping;
  readonly seen: SeenCamera;
  readonly toolbar: Toolbar;
  readonly notice: Notice;
  readonly token: AccessToken;
  readonly storage: KeptTexts;
  readonly reduced_motion: boolean;
}

export function make_page_parts(token: AccessToken): PageParts {
  const view = by_id('view', HTMLElement);
  const clock = clock_from(performance.timeOrigin);
  const reduced_motion = matchMedia('(prefers-reduced-motion: reduce)').matches;
  const worker = new WorkerClient();
  const notice = new Notice();
  const gate = new ScrollGate(view, location, window.parent !== window);
  gate.refused.listen(() => notice.show(text.page.click_first, 2));
  gate.opened.listen(() => notice.withdraw(text.page.click_first));
  const navigation = new Navigation(view, worker, clock, reduced_motion, gate);
  const clipping = new Clipping(worker, navigation);
  const toolbar = new Toolbar(navigation);
  const seen = new SeenCamera(worker, navigation, view);
  const storage = browser_storage('localStorage');
  return {
    view,
    clock,
    worker,
    navigation,
    clipping,
    seen,
    toolbar,
    notice,
    token,
    storage,
    reduced_motion,
  };
}
