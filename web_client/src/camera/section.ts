// A section of a scene as links and tours have it, and `catgs-render --section`. Pure.

/** An upright box, outside of which nothing is drawn: x, y, z, width, depth, height, turn in degrees. */
export type Section = readonly number[];

/** World units. */
export const side_range = [1e-5, 1e9] as const;

/** Undefined where the numbers are none of a section. */
export const section_of = (numbers: readonly number[]): Section | undefined =>
  numbers.length === 7 &&
  numbers.every((v, i) => Math.abs(v) <= side_range[1] && (i < 3 || i > 5 || v >= side_range[0]))
    ? numbers
    : undefined;
