// Where points of the map are in the plan, and back. Pure.
export interface PlanView {
  /** Cells that are in the middle. */
  readonly east: number;
  readonly north: number;
  readonly px_per_cell: number;
  /** What is up, clockwise from north; rad. */
  readonly up_rad: number;
  readonly width_px: number;
  readonly height_px: number;
}

export function px_of(
  view: PlanView,
  east: number,
  north: number,
): readonly [x: number, y: number] {
  const [dx, dy] = [(east - view.east) * view.px_per_cell, (view.north - north) * view.px_per_cell];
  const [c, s] = [Math.cos(view.up_rad), Math.sin(view.up_rad)];
  return [view.width_px / 2 + dx * c + dy * s, view.height_px / 2 - dx * s + dy * c];
}

export function cells_of(
  view: PlanView,
  x: number,
  y: number,
): readonly [east: number, north: number] {
  const [dx, dy] = [x - view.width_px / 2, y - view.height_px / 2];
  const [c, s] = [Math.cos(view.up_rad), Math.sin(view.up_rad)];
  return [
    view.east + (dx * c - dy * s) / view.px_per_cell,
    view.north - (dx * s + dy * c) / view.px_per_cell,
  ];
}
