import { clamp } from '../base/vector';
import type { Sides } from '../present/warp';
import type { Quality, View } from '../session/quality';
import type { SettingsInit } from '../wire/wire';

const wire_most_px = 8192;

const aspect_of = ({ width_px, height_px }: View): number => width_px / height_px;

/**
 * Frame sizes: the chosen heights or those of the view, in the view's aspect, with overscan. No side is longer
 * than `most_px`, because a weak GPU draws nothing of larger pictures.
 */
export function frame_sizes(
  view: View,
  quality: Quality,
  overscan: Sides,
  most_px: number,
): SettingsInit {
  const most = Math.min(wire_most_px, most_px);
  const size = (chosen_px: number): readonly [width: number, height: number] => {
    const height_px = (chosen_px > 0 ? chosen_px : view.height_px) * overscan.y;
    const width_px = (height_px / overscan.y) * aspect_of(view) * overscan.x;
    const fit = Math.min(1, most / width_px, most / height_px);
    return [frame_side(width_px * fit), frame_side(height_px * fit)];
  };
  const [widthPx, heightPx] = size(quality.height_px);
  const [stillWidthPx, stillHeightPx] = size(quality.still_height_px);
  return { widthPx, heightPx, stillWidthPx, stillHeightPx, maxFps: quality.max_fps };
}

/** Limits a side to the range of the wire and makes it even, because 4:2:0 video has no odd sides. */
const frame_side = (px: number): number => clamp(Math.round(px / 2) * 2, 16, wire_most_px);
