import type { Vec3 } from '../base/vector';

/** Somebody who walks on the ground of a scene. World axes and units. */
export interface Ground {
  readonly eye_height: number;
  /** Comes to stand on the ground near here, and returns where the eyes are then; undefined: nowhere. */
  stand_near(position: Vec3): Vec3 | undefined;
  /** Walks as far as the ground allows, and returns where the eyes are then. */
  walk(movement: Vec3): Vec3;
}
