// Boxes that stand upright: sections as the page works with them. Pure.
import {
  add,
  axis_angle,
  cross,
  dot,
  from_axes,
  length,
  normalize,
  right,
  rotate,
  scale,
  sub,
  forward,
  type Vec3,
} from '../base/vector';
import type { ClipBox, ClipPlane } from './eye';
import type { Section } from './section';

export interface UprightBox {
  readonly centre: Vec3;
  /** Width, depth and height, world units. */
  readonly size: Vec3;
  /** About up. */
  readonly turn_rad: number;
}

export type Axes = readonly [width: Vec3, depth: Vec3, up: Vec3];

/** Axes of an upright box. render_core/math/look_at.h has the same. */
export function upright_axes(up: Vec3, turn_rad: number): Axes {
  const axis = Math.abs(up[0]) < 0.9 ? right : forward;
  const level = normalize(sub(axis, scale(up, dot(axis, up))), right);
  const width = rotate(axis_angle(up, turn_rad), level);
  return [width, cross(up, width), up];
}

const least_size = 1e-5;

/** What is drawn of a section, under a ceiling where there is one. */
export function clip_box(section: Section, up: Vec3, ceiling: ClipPlane | undefined): ClipBox {
  const { centre, size, turn_rad } = box_of(section);
  const axes = upright_axes(up, turn_rad);
  const [width, depth, height] = size;
  const below = ceiling
    ? ceiling.offset / length(ceiling.normal) - dot(up, centre) + height / 2
    : height;
  const kept = Math.max(least_size, Math.min(height, below));
  return {
    world_from_box: {
      position: add(centre, scale(up, (kept - height) / 2)),
      orientation: from_axes(...axes),
    },
    half_extent: [width / 2, depth / 2, kept / 2],
  };
}

export function box_of([x, y, z, width, depth, height, turn_deg]: Section): UprightBox {
  return {
    centre: [x!, y!, z!],
    size: [width!, depth!, height!],
    turn_rad: (turn_deg! * Math.PI) / 180,
  };
}

export const section_of_box = ({ centre, size, turn_rad }: UprightBox): Section => [
  ...centre,
  ...size,
  (turn_rad * 180) / Math.PI,
];
