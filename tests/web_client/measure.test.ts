// Lengths, heights and areas, with their errors.
import { describe, expect, it } from 'vitest';
import { add, normalize, rotate, scale, type Quat, type Vec3 } from '#client/base/vector';
import { pixel_at, project, ray_through, visible_part } from '#client/camera/ray';
import { area_of, length_of, rise_of, type Mark } from '#client/measure/measurement';
import { bar_within, rough, usual_system, written, written_on_line } from '#client/measure/units';
import { nothing_said, TourDraft } from '#client/tour/draft';
import { MeasureList } from '#client/tour/measure_list';
import {
  measure_of,
  measures_for,
  measures_of_link,
  read_measures,
  write_measures,
  type Measure,
} from '#client/tour/measures';
import { share_address } from '#client/tour/share';
import { scene } from './cameras';

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

describe('a pixel at a point of the scene', () => {
  const orientation: Quat = [0, 0.6, 0, 0.8];
  it.each([
    [0.4, undefined, 0.5, 0.5],
    [1, undefined, 0.9, 0.2],
    [2.2, undefined, 0.5, 0.5],
    [2.2, undefined, 0.95, 0.9],
    [1, 12, 0.9, 0.2],
  ])('has its size in %d rad, or a view %s high, at %d, %d', (fov_y_rad, view_height, x, y) => {
    const eye = { position: [1, 2, 3] as Vec3, orientation, fov_y_rad, view_height };
    const { origin, direction } = ray_through(eye, x, y, 2);
    const point = add(origin, scale(direction, 7));
    const below = rotate(orientation, [0, pixel_at(point, eye, 500), 0]);
    expect(project(add(point, below), eye, 2)![1]).toBeCloseTo(y + 1 / 500, 9);
  });
});

describe('the part of a line that is seen', () => {
  const eye = { position: [0, 0, 0], orientation: [0, 0, 0, 1], fov_y_rad: Math.PI / 2 } as const;

  it.each<[Vec3, Vec3, number[] | undefined]>([
    [
      [-0.5, 0, 1],
      [0.5, 0, 1],
      [0.25, 0.5, 0.75, 0.5],
    ],
    [
      [0, 0, 1],
      [4, 0, 1],
      [0.5, 0.5, 1, 0.5],
    ], // it leaves the view
    [
      [0.5, 0, 1],
      [0.5, 0, -3],
      [0.75, 0.5, 1, 0.5],
    ], // it ends behind the eye
    [[-1, -1, -1], [1, 1, -1], undefined],
    [[2, 0, 1], [3, 0, 1], undefined],
  ])('from %j to %j', (from, to, expected) => {
    const seen = visible_part(from, to, eye, 1)?.flat();
    expect(seen?.map((v) => Math.round(v * 1e6) / 1e6)).toEqual(expected);
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

  it('have fewer digits at the line, and three where no error is known', () => {
    expect(written_on_line({ value: 6.841, error: 0.1 }, metric)).toBe('3.42\u00a0m');
    expect(written_on_line({ value: 6.841, error: 0 }, metric)).toBe('3.42\u00a0m');
    expect(written({ value: 0.05, error: 0 }, metric)).toBe('2.50\u00a0cm');
    expect(written_on_line({ value: 8, error: 1 }, metric, 2)).toBe('2.0\u00a0m²');
    expect(rough(49.3, metric, 2)).toBe('12\u00a0m²');
  });

  it.each([
    [20, metric, 20, '10\u00a0m'],
    [19.9, metric, 10, '5\u00a0m'],
    [0.9, metric, 0.4, '20\u00a0cm'],
    [7, { metres_per_unit: undefined, system: 'metric' } as const, 5, '5'],
    [10, { metres_per_unit: 0.3048, system: 'imperial' } as const, 10, '10\u00a0ft'],
  ])('a bar of at most %d is round', (most, scale, length, text) => {
    const bar = bar_within(most, scale);
    expect(bar.length).toBeCloseTo(length);
    expect(bar.text).toBe(text);
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

describe('measures', () => {
  const door: Measure = {
    ...measure_of([mark([1, 2, 3], 0.01, 0.02), mark([4, 5, 6.123456789], 0.03)]),
    title: 'Door, left ~ 1',
    translations: new Map([['de', { title: 'Tür', caption: '' }]]),
  };
  const pick = ({ title, marks }: Measure): object => ({
    title,
    marks: marks.map(({ point }) => point),
  });
  const link = (measures: readonly Measure[]): string => {
    const view = { eye: undefined, mode: undefined, tour_index: undefined, stop_index: undefined };
    return share_address('http://host/?token=secret', 'hall', view, measures);
  };

  it('come back from a sidecar as they were written, with what they may be off by', () => {
    const written: unknown = JSON.parse(
      JSON.stringify(write_measures([door, measure_of([mark([0, 0, 0])])])),
    );
    expect(written).toEqual([
      {
        title: 'Door, left ~ 1',
        translations: { de: { title: 'Tür' } },
        marks: [
          { position: [1, 2, 3], error: 0.04, depth: [0, 0, 0.02] },
          { position: [4, 5, 6.123457], error: 0, depth: [0, 0, 0.06] },
        ],
      },
    ]);
    const { measures, problems } = read_measures(written);
    expect(problems).toEqual([]);
    expect(write_measures(measures)).toEqual(written);
    expect(measures_for(measures, ['de'])[0]!.title).toBe('Tür');
    expect(length_of(measures[0]!.marks).error).toBeCloseTo(length_of(door.marks).error, 6);
  });

  it('come back from a link, with any name', () => {
    const address = link([door]);
    expect(address).toContain('#measure=1,2,3,0.04,0,0,0.02,4,5,6.12346,0,0,0,0.06%7EDoor');
    const { measures, problems } = measures_of_link(address);
    expect(problems).toEqual([]);
    expect(measures.map(pick)).toEqual([
      {
        title: 'Door, left ~ 1',
        marks: [
          [1, 2, 3],
          [4, 5, 6.12346],
        ],
      },
    ]);
    expect(link([])).toBe('http://host/?scene=hall');
  });

  it('in a link are as many as it has room for', () => {
    const long = measure_of(Array.from({ length: 90 }, () => mark([1, 2, 3])));
    expect(measures_of_link(link(Array<Measure>(20).fill(door))).measures).toHaveLength(16);
    expect(measures_of_link(link([long, long, long])).measures).toHaveLength(2);
  });

  it.each([
    ['1,2,3,0,0,0,0', 'measure[0].marks: has 1 entries, at least 2'],
    ['1,2,3,0,0,0,0,4,5,6', 'measure[0].marks[1].error: is not a number in'],
    ['1,2,3,0,0,0,0,4,5,6,0,0,0', 'measure[0].marks[1].depth: does not have 3 numbers'],
    ['1,2,3,0,0,0,0,4,5,x,0,0,0,0', 'measure[0].marks[1].position[2]: is not a number in'],
    ['1,2,3,0,0,0,0,4,5,,0,0,0,0', 'measure[0].marks[1].position[2]: is not a number in'],
    ['1,2,3,0,0,0,0,4,5,1e400,0,0,0,0', 'measure[0].marks[1].position[2]: is not a number in'],
    ['1,2,3,-1,0,0,0,4,5,6,0,0,0,0', 'measure[0].marks[0].error: is not a number in'],
    ['1,2,3,0,0,0,0,'.repeat(101).slice(0, -1), 'measure[0].marks: has 101 entries, at most 100'],
  ])('%s of a link are refused by their field, and hide no others', (written, complaint) => {
    const { measures, problems } = measures_of_link(
      `http://host/#measure=${written}&measure=0,0,0,0,0,0,0,1,1,1,0,0,0,0`,
    );
    expect(problems).toHaveLength(1);
    expect(problems[0]).toContain(complaint);
    expect(measures).toHaveLength(1);
  });

  it.each([
    [{}, 'measures: is not a list'],
    [Array(65).fill({}), 'measures: has 65 entries, at most 64'],
    [[{ title: 'x' }], "measures[0]: 'marks' is missing"],
    [[{ marks: [{}, {}] }], "measures[0].marks[0]: 'position' is missing"],
  ])('%j of a sidecar are refused by their field', (document, complaint) => {
    expect(read_measures(document).problems).toEqual([complaint]);
  });

  it('grow by marks, are moved, named and removed', () => {
    const list = new MeasureList();
    const fields: (string | undefined)[] = [];
    list.changed.listen((field) => fields.push(field));
    list.enter([], [door]);
    expect(list.all).toEqual([door]);
    list.add(mark([0, 0, 0]));
    list.add(mark([0, 0, 1]));
    list.choose(undefined);
    list.add(mark([5, 5, 5]));
    expect(list.own.map(({ marks }) => marks.length)).toEqual([2, 1]);
    list.move(0, 1, mark([0, 0, 2]));
    list.rename(0, 'Shelf');
    expect(pick(list.own[0]!)).toEqual({
      title: 'Shelf',
      marks: [
        [0, 0, 0],
        [0, 0, 2],
      ],
    });
    list.edit_language('de');
    list.rename(0, 'Regal');
    expect(measures_for(list.own, ['de'])[0]!.title).toBe('Regal');
    expect(list.own[0]!.title).toBe('Shelf');
    // A drag, or a text typed in one language, is one edit.
    expect(fields.filter(Boolean)).toEqual(['mark 0 1', 'name 0 ', 'name 0 de']);
    list.remove_mark(1, 0);
    list.remove(0);
    expect(list.all).toEqual([door]);
    list.rename(0, 'not mine');
    list.remove_mark(0, 0);
    expect(list.all).toEqual([door]);
  });

  it('get the marks that were asked for in their order, before they are saved', async () => {
    const list = new MeasureList();
    const answers: ((mark: Mark) => void)[] = [];
    const became = [true, true, false].map((counts) => {
      const asked = new Promise<Mark>((answer) => answers.push(answer));
      return list.add_found(asked, () => counts);
    });
    const saved = list.known.then(() => list.own);
    answers[2]!(mark([3, 0, 0]));
    answers[1]!(mark([2, 0, 0]));
    answers[0]!(mark([1, 0, 0]));
    expect(await Promise.all(became)).toEqual(['added', 'added', 'outdated']);
    expect((await saved)[0]!.marks.map(({ point }) => point[0])).toEqual([1, 2]);
    const nothing = list.add_found(Promise.resolve(undefined), () => true);
    expect(await nothing).toBe('nothing');
  });

  it('of a link are added once, and not where the scene has them', () => {
    const { measures: linked } = measures_of_link(
      link([door, measure_of([mark([0, 0, 0]), mark([1, 1, 1])])]),
    );
    const list = new MeasureList();
    list.enter([], [door]);
    list.join(linked);
    list.join(linked);
    expect(list.own).toEqual([linked[1]]);
    list.enter(linked, [door]);
    expect(list.own).toEqual([linked[1]]);
    const all = Array<Measure>(64).fill(door);
    list.enter(all, []);
    expect(list.own).toBe(all); // an author has changed nothing yet
    list.join(linked);
    expect(list.own).toHaveLength(64);
  });

  it('have room for so many and no more', () => {
    const list = new MeasureList();
    for (let k = 0; k < 100; ++k) expect(list.add(mark([k, 0, 0]))).toBe(true);
    expect(list.add(mark([0, 0, 0]))).toBe(false);
    list.enter(Array<Measure>(64).fill(door), []);
    expect(list.add(mark([0, 0, 0]))).toBe(false);
  });

  it('stay in the sidecar that an author saves, and are taken back by Undo', () => {
    const draft = new TourDraft();
    draft.load([], nothing_said, [door]);
    expect(draft.sidecar(scene)).toMatchObject({ measures: [{ title: 'Door, left ~ 1' }] });
    draft.edit({ measures: [] });
    expect(draft.sidecar(scene)).not.toHaveProperty('measures');
    draft.undo();
    expect(draft.state.measures).toEqual([door]);
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
