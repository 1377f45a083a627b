// The camera of the page under test.
import type { Page } from 'playwright-core';
import type { Pose } from '#client/camera/camera_controller';

export const settle = (page: Page): Promise<void> => page.evaluate(() => window.catgs!.settled());

export const pose_of = (page: Page): Promise<Pose> => page.evaluate(() => window.catgs!.pose());

export const distance = (a: Pose, b: Pose): number =>
  Math.hypot(...a.position.map((v, i) => v - b.position[i]!));
