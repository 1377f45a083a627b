import { readFileSync } from 'node:fs';
import { describe, expect, it } from 'vitest';
import { angle_between, look_at, rotate, type Vec3 } from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import { film_flight, type Film } from '#client/tour/camera_spline';
import * as limits from '#client/tour/limits';
import { read_document } from '#client/tour/load';
import { embed_code, frame_sites, read_shared, share_address } from '#client/tour/share';
import { read_supersplat } from '#client/tour/supersplat';
import { default_stay_s, read_tours, write_tours } from '#client/tour/tour';
import { uncovered } from '#client/ui/uncovered';
import settings from '../support/supersplat_settings.json';
import { expect_vec } from './cameras';

const up: Vec3 = [0, -1, 0];

describe('tours of a sidecar', () => {
  const written = [
    {
      title: 'Ground floor',
      autoplay: true,
      stops: [
        {
          title: 'Hall',
          position: [0, 0, 0],
          look_at: [0, 0, 4],
          fov_deg: 50,
          stay_s: 2,
          fly_s: 3,
        },
        {
          title: 'Stairs',
          caption: 'Built in 1904.',
          position: [1, 2, 3],
          orientation: [0, 0.6, 0, 0.8],
          marker: [1, 2, 9],
        },
      ],
    },
  ];

  it('are read, with what was left out filled in', () => {
    const [tour] = read_tours(written, up, 1.2);
    expect(tour).toMatchObject({ title: 'Ground floor', starts_itself: true, way: undefined });
    const [hall, stairs] = tour!.stops;
    expect_vec(rotate(hall!.eye.orientation, [0, 0, 1]), [0, 0, 1]);
    expect(hall!.eye.fov_y_rad).toBeCloseTo((50 * Math.PI) / 180, 6);
    expect(hall!.marker).toBeUndefined();
    expect(hall).toMatchObject({ stay_s: 2, fly_s: 3 });
    expect(stairs).toMatchObject({ caption: 'Built in 1904.', marker: [1, 2, 9] });
    expect(stairs!.eye.fov_y_rad).toBe(1.2);
    expect(stairs).toMatchObject({ stay_s: undefined, fly_s: undefined });
    expect(default_stay_s(stairs!)).toBeGreaterThan(3);
  });

  it('have the same limits here and at the server', () => {
    const server = ['render_core/scene/files/tour_check.cpp', 'server/scenes/tours.h']
      .map((name) => readFileSync(new URL(`../../${name}`, import.meta.url), 'utf8'))
      .join('');
    const limit = (name: string): number => {
      const found = new RegExp(
        `constexpr (?:std::size_t|float) ${name} = (\\d[\\d']*)(?: << (\\d+))?;`,
      ).exec(server);
      if (!found) throw new Error(`the server has no ${name}`);
      return Number(found[1]!.replaceAll("'", '')) * 2 ** Number(found[2] ?? 0);
    };
    for (const name of [
      'max_tours',
      'max_stops',
      'max_languages',
      'max_measures',
      'max_marks',
    ] as const)
      expect(limits[name]).toBe(limit(name));
    expect(limits.longest_stay_s).toBe(limit('longest_stay_s'));
    expect(limits.longest_flight_s).toBe(limit('longest_flight_s'));
    expect(limits.max_sidecar_bytes).toBe(limit('max_sent_sidecar_bytes'));
    // The server counts bytes; a character of UTF-8 has at most four.
    expect(limits.max_text_characters * 4).toBe(limit('max_text_bytes'));
  });

  it('come back as they were written', () => {
    const tours = read_tours(written, up, 1.2);
    const again = read_tours(write_tours(tours), up, 0.5);
    expect(again).toHaveLength(1);
    again[0]!.stops.forEach((stop, i) => {
      const before = tours[0]!.stops[i]!;
      expect(stop).toMatchObject({ title: before.title, caption: before.caption });
      expect_vec(stop.eye.position, before.eye.position);
      expect(angle_between(stop.eye.orientation, before.eye.orientation)).toBeLessThan(1e-3);
      expect(stop.eye.fov_y_rad).toBeCloseTo(before.eye.fov_y_rad, 5);
    });
  });

  it.each([
    [{}, 'tours: is not a list'],
    [[{ title: 'x' }], "tours[0]: 'stops' is missing"],
    [[{ stops: [{ position: [1, 2] }] }], 'tours[0].stops[0].position: does not have 3 numbers'],
    [
      [{ stops: [{ position: [1, 2, 'x'], orientation: [0, 0, 0, 1] }] }],
      'position[2]: is not a number',
    ],
    [
      [{ stops: [{ position: [0, 0, 0] }] }],
      "tours[0].stops[0]: 'look_at' or 'orientation' is missing",
    ],
    [[{ stops: [], title: 7 }], 'tours[0].title: is not text'],
    [Array(33).fill({ stops: [] }), 'has 33 entries, at most 32'],
  ])('say what is wrong with %j', (document, complaint) => {
    expect(() => read_tours(document, up, 1)).toThrow(complaint);
  });

  it('that cannot be read do not hide the others', () => {
    const { tours, start, problems } = read_document(
      { tours: {}, settings, read_settings: read_supersplat },
      up,
      1,
      16 / 9,
    );
    expect(problems).toEqual(['tours: is not a list']);
    expect(tours.length).toBeGreaterThan(0);
    expect(start).toBeDefined();
    expect(read_document({}, up, 1, 1)).toMatchObject({
      tours: [],
      start: undefined,
      problems: [],
    });
  });

  it("take the place of imported stops, so that an author's changes do not stand beside them", () => {
    const own = [{ title: 'Mine', stops: [{ position: [0, 0, 0], orientation: [0, 0, 0, 1] }] }];
    const { tours, start } = read_document(
      { tours: own, settings, read_settings: read_supersplat },
      up,
      1,
      1,
    );
    expect(tours[0]!.title).toBe('Mine');
    expect(tours.slice(1).every(({ way }) => way !== undefined)).toBe(true);
    expect(start).toBeUndefined();
    const { tours: none } = read_document(
      { tours: [], settings, read_settings: read_supersplat },
      up,
      1,
      1,
    );
    expect(none.every(({ way }) => way !== undefined)).toBe(true);
  });
});

describe("the SuperSplat viewer's settings.json", () => {
  it('becomes a tour of its annotations, a film for each track, and a start', () => {
    const { tours, start } = read_supersplat(settings, 1);
    expect(tours.map(({ title, stops, way }) => [title, stops.length, way !== undefined])).toEqual([
      ['', 2, false],
      ['cameraAnim', 0, true],
    ]);
    // SuperSplat turns the scene upside down, so x and y change their signs.
    expect_vec(start!.position, [-2, -1.5, -4]);
    const view = rotate(start!.orientation, [0, 0, 1]);
    const to_target = [2, 1.5 - 1, 4].map((v) => v / Math.hypot(2, 0.5, 4));
    expect_vec(view, to_target);
    expect(rotate(start!.orientation, [0, 1, 0])[1]).toBeGreaterThan(0.9);
    const [door] = tours[0]!.stops;
    expect(door).toMatchObject({ title: 'The door', caption: 'It squeaks.' });
    expect_vec(door!.marker!, [-0.5, -1.2, 3]);
  });

  it('has fields of view of the longer side', () => {
    const wide = read_supersplat(settings, 2).start!.fov_y_rad;
    const tall = read_supersplat(settings, 0.5).start!.fov_y_rad;
    expect(tall).toBeCloseTo((75 * Math.PI) / 180, 6);
    expect(Math.tan(wide / 2)).toBeCloseTo(Math.tan(tall / 2) / 2, 6);
  });

  it('leads along its track and around', () => {
    const { way } = read_supersplat(settings, 1).tours[1]!;
    expect(way!.repeats).toBe(true);
    expect_vec(way!.at(0).position, [-2, -1.5, -4]);
    expect_vec(way!.at(2).position, [2, -1.5, -4]);
    const end = way!.at(way!.duration_s - 1e-4);
    expect_vec(end.position, [-2, -1.5, -4], 2);
  });

  it.each([
    [{ version: 1 }, 'version 1 is not supported'],
    [{ version: 2, cameras: [{}] }, "settings.json.cameras[0]: 'initial' is missing"],
    [{ version: 2, annotations: 5 }, 'annotations: is not a list'],
    [
      { version: 2, animTracks: [{ duration: 1, frameRate: 30, keyframes: { times: [0, 0] } }] },
      'times: are not increasing',
    ],
  ])('is refused with the field that is wrong: %j', (document, complaint) => {
    expect(() => read_supersplat(document, 1)).toThrow(complaint);
  });
});

describe('a film of the camera', () => {
  const film = (change: Partial<Film> = {}): Film => ({
    times_s: [0, 1, 3],
    shots: ([0, 2, 4] as const).map((x) => ({
      position: [x, 0, 0] as Vec3,
      target: [x, 0, 5] as Vec3,
      fov_y_rad: 1,
    })),
    duration_s: 4,
    smoothness: 1,
    steps: false,
    loop: 'none',
    ...change,
  });
  const x_at = (change: Partial<Film>, time_s: number): number =>
    film_flight(film(change), up).at(time_s).position[0];

  it('passes its shots at their times, without a jump in speed', () => {
    for (const [time_s, x] of [
      [0, 0],
      [1, 2],
      [3, 4],
      [4, 4],
    ] as const) {
      expect(x_at({}, time_s)).toBeCloseTo(x, 6);
    }
    const h = 1e-4;
    const before = (x_at({}, 1) - x_at({}, 1 - h)) / h;
    const after = (x_at({}, 1 + h) - x_at({}, 1)) / h;
    expect(before).toBeCloseTo(after, 2);
    expect(before).toBeCloseTo(4 / 3, 2);
  });

  it('rests at its shots without smoothness, and jumps in steps', () => {
    const h = 1e-3;
    expect((x_at({ smoothness: 0 }, 1 + h) - 2) / h).toBeLessThan(0.02);
    expect(x_at({ steps: true }, 2.9)).toBe(2);
  });

  it('goes back in a ping-pong, and around when it repeats', () => {
    expect(film_flight(film({ loop: 'pingpong' }), up).duration_s).toBe(8);
    expect(x_at({ loop: 'pingpong' }, 7)).toBeCloseTo(2, 6);
    const around = film({ loop: 'repeat', duration_s: 3 });
    expect(film_flight(around, up).duration_s).toBe(4); // a second for the way back
    expect(film_flight(around, up).at(4 - 1e-6).position[0]).toBeCloseTo(0, 3);
  });

  it('of one shot stays there', () => {
    const one = film({ times_s: [0], shots: [film().shots[1]!], loop: 'repeat' });
    expect(film_flight(one, up).at(2).position).toEqual([2, 0, 0]);
  });
});

describe('a shared link', () => {
  const eye: Eye = {
    position: [1.25, -2, 300.5],
    orientation: look_at([0, 0, 0], [1, 1, 1], up),
    fov_y_rad: 1,
  };

  it('leads back to the view, without a token or a query of others', () => {
    const address = share_address('https://host/x/?author&presenter=2d#token=s3cret', 'city', {
      eye,
      mode: 'walk',
      up: [0, 0.6, -0.8],
      tour_index: 1,
      stop_index: 3,
    });
    expect(address).not.toContain('s3cret');
    expect(address).not.toContain('author');
    expect(address).toMatch(/^https:\/\/host\/x\/\?scene=city#at=1\.25,-2,300\.5,/);
    const shared = read_shared(address);
    expect(shared).toMatchObject({ mode: 'walk', tour_index: 1, stop_index: 3 });
    expect_vec(shared.up!, [0, 0.6, -0.8]);
    expect_vec(shared.eye!.position, eye.position);
    expect(angle_between(shared.eye!.orientation, eye.orientation)).toBeLessThan(1e-3);
    expect(shared.eye!.fov_y_rad).toBeCloseTo(1, 4);
  });

  it('keeps its digits far from 0', () => {
    const far = { ...eye, position: [500123.4321, 5412345.3123, -431.2] as const };
    const nowhere = { mode: undefined, tour_index: undefined, stop_index: undefined };
    const address = share_address('https://host/', 'city', { eye: far, ...nowhere });
    expect_vec(read_shared(address).eye!.position, far.position, 4);
  });

  it.each(['', '1,2,3', '1,2,3,0,0,0,9,60', '1,2,x,0,0,0,1,60', '1,2,3,0,0,0,1,999', ',,,,,,,'])(
    'with nonsense "%s" leads nowhere',
    (at) => {
      expect(read_shared(`https://host/#at=${at}`).eye).toBeUndefined();
    },
  );

  it('knows modes and stops that there are', () => {
    const shared = read_shared('https://host/#mode=swim&stop=0&tour=-1&up=1,1,0');
    expect(new Set(Object.values(shared))).toEqual(new Set([undefined]));
  });

  it('becomes a frame for other pages', () => {
    const code = embed_code('https://host/?scene=a&x=%22#stop=2');
    expect(code).toContain('src="https://host/?scene=a&amp;x=%22&amp;ui=0#stop=2"');
  });

  it("knows from the page's policy who may show it", () => {
    const policy = (sites: string): string =>
      `default-src 'none'; frame-ancestors ${sites}; img-src *`;
    const [a, b] = ['https://a.example', 'https://*.b.example'];
    const both = policy(`${a} ${b}`);
    for (const [header, sites] of [
      ...[
        [policy("'none'"), []],
        [both, [a, b]],
        [policy('*'), undefined],
      ],
      ...[
        ["default-src 'self'", undefined],
        [null, undefined],
      ],
      ...[
        [`${both}, ${policy(b)}`, [b]],
        [`${both}, default-src 'self'`, [a, b]],
      ],
      [`default-src 'self', ${both}, ${policy("'none'")}`, []],
    ] as const) {
      expect(frame_sites(header), String(header)).toEqual(sites);
    }
  });
});

describe('the hotspot of the stop that is shown', () => {
  const card = { left: 12, right: 378, top: 580, bottom: 766 };
  const toolbar = { left: 6, right: 384, top: 776, bottom: 830 };

  it.each([
    ['stays where nothing covers it', [200, 300], [200, 300]],
    ['comes above the card', [200, 620], [200, 556]],
    ['is not touched by the card', [200, 570], [200, 556]],
    ['comes out from between card and toolbar', [200, 771], [200, 556]],
  ] as const)('%s on a phone', (_, at, to) => {
    expect(uncovered(at, [card, toolbar], [390, 844])).toEqual(to);
  });

  it.each([
    ['beside the card', [280, 600], [316, 600]],
    ['above it, where that is nearer', [100, 500], [100, 459]],
    ['as it is where no place is free', [20, 20], [20, 20]],
  ] as const)('comes %s on a desktop', (_, at, to) => {
    const all = { left: 0, right: 1280, top: 0, bottom: 720 };
    const covers = at[0] === 20 ? [all] : [{ left: 12, right: 292, top: 483, bottom: 706 }];
    expect(uncovered(at, covers, [1280, 720])).toEqual(to);
  });
});
