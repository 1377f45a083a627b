// The camera of the page under test.
import type { Pose } from '#client/camera/eye';

/** A page of Chromium or Firefox. Functions see nothing but the page. */
export interface AnyPage {
  evaluate<T>(what: string | (() => T | Promise<T>)): Promise<T>;
}

/** Works right after a link was followed, too, before the script of the new document has run. */
export const settle = (page: AnyPage): Promise<void> =>
  page.evaluate(async () => {
    while (!window.catgs) await new Promise((resolve) => setTimeout(resolve, 20));
    await window.catgs.settled();
  });

export const pose_of = (page: AnyPage): Promise<Pose> => page.evaluate(() => window.catgs!.pose());

export const distance = (a: Pose, b: Pose): number =>
  Math.hypot(...a.position.map((v, i) => v - b.position[i]!));
