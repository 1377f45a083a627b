import type { Vec3 } from '../base/vector';

/** Walks on the walkable area of a scene. World axes and units. */
export interface Walker {
  readonly eye_height: number;
  /** Comes to stand on the floor here, and returns where the eyes are then; undefined: that is over a step away. */
  stand_near(position: Vec3): Vec3 | undefined;
  /** Walks as far as the walkable area allows, and returns where the eyes are then. */
  walk(movement: Vec3): Vec3;
}
