// Lengths, heights and areas, with their errors.
import { describe, expect, it } from 'vitest';
import { normalize, type Vec3 } from '#client/base/vector';
import { area_of, length_of, rise_of, type Mark } from '#client/measure/measurement';
import { usual_system, written } from '#client/measure/units';

const mark = (point: Vec3, along = 0, across = 0, direction: Vec3 = [0, 0, 1]): Mark => ({
  point,
  direction,
  along,
  across,
});

describe('measuring', () => {
  it('adds up lengths along the marks', () => {
    const marks = [mark([0, 0, 0]), mark([3, 4, 0]), mark([3, 4, 12])];
    expect(length_of(marks)).toEqual({ value: 17, error: 0 });
    expect(length_of([mark([1, 1, 1])]).value).toBe(0);
    expect(length_of([]).value).toBe(0);
  });

  it('tells heights along the up axis, also downwards', () => {
    const marks = [mark([0, 1, 0]), mark([9, -1, 9])];
    expect(rise_of(marks, [0, -1, 0]).value).toBe(2);
    expect(rise_of(marks, [0, 1, 0]).value).toBe(-2);
  });

  it('tells the area of a polygon in any plane, however it is turned', () => {
    const square: Vec3[] = [
      [0, 0, 0],
      [2, 0, 0],
      [2, 0, 3],
      [0, 0, 3],
    ];
    expect(area_of(square.map((point) => mark(point))).value).toBeCloseTo(6);
    expect(area_of([...square].reverse().map((point) => mark(point))).value).toBeCloseTo(6);
    const tilted = square.map(
      ([x, , z]): Vec3 => [x * Math.SQRT1_2 + 100, x * Math.SQRT1_2, z - 50],
    );
    expect(area_of(tilted.map((point) => mark(point))).value).toBeCloseTo(6);
  });

  it('states the error by how deep and how exactly the places were found', () => {
    // Along the ray, only depth counts: two surfaces of depth 0.3 and 0.4, at two standard deviations.
    const behind = [mark([0, 0, 1], 0.3, 9), mark([0, 0, 5], 0.4, 9)];
    expect(length_of(behind).error).toBeCloseTo(2 * 0.5);
    const beside = [mark([0, 0, 1], 9, 0.3), mark([5, 0, 1], 9, 0.4)];
    expect(length_of(beside).error).toBeCloseTo(2 * 0.5);
    expect(rise_of(beside, [0, 1, 0]).error).toBeCloseTo(2 * 0.5);
  });

  it('states an error that holds for marks that are off by as much', () => {
    const random = lcg(7);
    const places: Vec3[] = [
      [0, 0, 4],
      [3, 0, 5],
      [3, 2, 6],
      [0, 2, 5],
    ];
    const marks = places.map((point) => mark(point, 0.02, 0.01, normalize(point, [0, 0, 1])));
    for (const measure of [length_of, area_of]) {
      const { value, error } = measure(marks);
      const tries = 2000;
      let within = 0;
      for (let i = 0; i < tries; ++i) {
        const moved = marks.map((at) => ({ ...at, point: off(at, random) }));
        if (Math.abs(measure(moved).value - value) <= error) within += 1;
      }
      expect(within / tries).toBeGreaterThan(0.93);
      expect(within / tries).toBeLessThan(0.975);
    }
  });
});

describe('units', () => {
  const metric = { metres_per_unit: 0.5, system: 'metric' } as const;

  it('fit the size, and decimals the error', () => {
    expect(written({ value: 6.841, error: 0.1 }, metric)).toBe('3.421\u00a0m ± 0.050\u00a0m');
    expect(written({ value: 0.05, error: 0.01 }, metric)).toBe('2.50\u00a0cm ± 0.50\u00a0cm');
    expect(written({ value: -6.841, error: 0.1 }, metric)).toBe('−3.421\u00a0m ± 0.050\u00a0m');
    expect(written({ value: 5000, error: 40 }, metric)).toBe('2.500\u00a0km ± 0.020\u00a0km');
    expect(written({ value: 8, error: 1 }, metric, 2)).toBe('2.00\u00a0m² ± 0.25\u00a0m²');
    expect(written({ value: 2, error: 0.1 }, { metres_per_unit: 0.3048, system: 'imperial' })).toBe(
      '2.00\u00a0ft ± 0.10\u00a0ft',
    );
  });

  it('are those of the scene where nobody has said its scale', () => {
    expect(
      written({ value: 1.25, error: 0.1 }, { metres_per_unit: undefined, system: 'metric' }),
    ).toBe('1.25 ± 0.10');
  });

  it('are imperial where people use them', () => {
    expect(['en-US', 'en-GB', 'de', 'my-MM'].map(usual_system)).toEqual([
      'imperial',
      'metric',
      'metric',
      'imperial',
    ]);
  });
});

/** A linear congruential generator, for tests that repeat. */
function lcg(seed: number): () => number {
  let state = seed;
  return () => {
    state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
    return (state + 0.5) / 2 ** 32;
  };
}

/** The mark's point, off by a Gaussian error along its ray and across it. */
function off({ point, direction, along, across }: Mark, random: () => number): Vec3 {
  const normal = (): number =>
    Math.sqrt(-2 * Math.log(random())) * Math.cos(2 * Math.PI * random());
  const noise: Vec3 = [normal() * across, normal() * across, normal() * across];
  const by = noise[0] * direction[0] + noise[1] * direction[1] + noise[2] * direction[2];
  const depth = normal() * along;
  return [0, 1, 2].map(
    (i) => point[i]! + noise[i]! + direction[i]! * (depth - by),
  ) as unknown as Vec3;
}
