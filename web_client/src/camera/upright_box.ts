// Boxes that stand upright: sections as the page works with them. Pure.
import {
  add,
  axis_angle,
  clamp,
  cross,
  dot,
  from_axes,
  length,
  normalize,
  right,
  rotate,
  same,
  scale,
  sub,
  forward,
  type Vec3,
} from '../base/vector';
import type { ClipBox, ClipPlane } from './eye';
import { side_range, type Section } from './section';

export interface UprightBox {
  readonly centre: Vec3;
  /** Width, depth and height, world units. */
  readonly size: Vec3;
  /** About up. */
  readonly turn_rad: number;
}

export type Axes = readonly [width: Vec3, depth: Vec3, up: Vec3];

export const limited_side = (length: number): number => clamp(length, ...side_range);

/** Axes of an upright box. render_core/math/look_at.h has the same. */
export function upright_axes(up: Vec3, turn_rad: number): Axes {
  const axis = Math.abs(up[0]) < 0.9 ? right : forward;
  const level = normalize(sub(axis, scale(up, dot(axis, up))), right);
  const width = rotate(axis_angle(up, turn_rad), level);
  return [width, cross(up, width), up];
}

/** What is drawn of a section, under a ceiling where there is one. */
export function clip_box(section: Section, up: Vec3, ceiling: ClipPlane | undefined): ClipBox {
  const { centre, size, turn_rad } = box_of(section);
  const axes = upright_axes(up, turn_rad);
  const [width, depth, height] = size;
  const below = ceiling
    ? ceiling.offset / length(ceiling.normal) - dot(up, centre) + height / 2
    : height;
  const kept = limited_side(Math.min(height, below));
  return {
    world_from_box: {
      position: add(centre, scale(up, (kept - height) / 2)),
      orientation: from_axes(...axes),
    },
    half_extent: [limited_side(width) / 2, limited_side(depth) / 2, kept / 2],
  };
}

const least_share = 1e-3; // of the scene's scale: no side is shorter

/** The least side of boxes in a scene with this scale to a visitor. World units. */
export const least_side = (reach: number): number => limited_side(least_share * reach);

const stray_share = 0.1; // floors and outer walls lie at the ends of the content

/** The upright box around all between two corners along the world's axes, and a little more. */
export function box_around(
  { min, max }: { readonly min: Vec3; readonly max: Vec3 },
  up: Vec3,
  turn_rad: number,
  reach: number,
): UprightBox {
  // As large along the axes of the turned box as along those of the world.
  const [width, depth, height] = upright_axes(up, turn_rad).map((axis) => {
    const length = axis.reduce((sum, v, i) => sum + Math.abs(v) * (max[i]! - min[i]!), 0);
    return limited_side(Math.max(least_side(reach), length * (1 + stray_share)));
  });
  return { centre: scale(add(min, max), 0.5), size: [width!, depth!, height!], turn_rad };
}

export function box_of([x, y, z, width, depth, height, turn_deg]: Section): UprightBox {
  return {
    centre: [x!, y!, z!],
    size: [width!, depth!, height!],
    turn_rad: (turn_deg! * Math.PI) / 180,
  };
}

/** The same box about another up (unit); where it does not stand upright there, the one that is turned least. */
export function section_about(section: Section, from: Vec3, to: Vec3): Section {
  if (same(from, to)) return section;
  const { centre, size, turn_rad } = box_of(section);
  const axes = upright_axes(from, turn_rad);
  const slopes = axes.map((axis) => Math.abs(dot(axis, to)));
  const height = slopes.indexOf(Math.max(...slopes));
  const [width, depth] = [(height + 1) % 3, (height + 2) % 3] as const;
  const [east, north] = upright_axes(to, 0);
  return section_of_box({
    centre,
    size: [size[width]!, size[depth]!, size[height]!],
    turn_rad: Math.atan2(dot(axes[width]!, north), dot(axes[width]!, east)),
  });
}

export const section_of_box = ({ centre, size, turn_rad }: UprightBox): Section => [
  ...centre,
  ...size,
  (turn_rad * 180) / Math.PI,
];
