import { describe, expect, it } from 'vitest';
import type { Vec3 } from '#client/base/vector';
import {
  film_eyes,
  film_fps,
  film_length_s,
  most_film_frames,
  write_tum,
  write_views,
} from '#client/film/path';
import { read_tours, type Tour } from '#client/tour/tour';
import { expect_vec } from './cameras';

const up: Vec3 = [0, -1, 0];
const stop = (z: number, stay_s: number, fly_s: number): object => ({
  position: [0, 0, z],
  look_at: [0, 0, z + 1],
  fov_deg: 60,
  stay_s,
  fly_s,
});
const tour_of = (...stops: object[]): Tour => read_tours([{ stops }], up, 1)[0]!;

describe('the camera of a film', () => {
  it('stays and flies as the page does', () => {
    const tour = tour_of(stop(0, 1, 9), stop(4, 0.5, 2));
    expect(film_length_s(tour, 5)).toBe(3.5); // nobody flies to the first stop
    const eyes = film_eyes(tour, 5);
    expect(eyes.length).toBe(3.5 * film_fps);
    expect_vec(eyes[0]!.position, [0, 0, 0]);
    expect_vec(eyes[film_fps - 1]!.position, [0, 0, 0]);
    expect_vec(eyes[2 * film_fps]!.position, [0, 0, 2]); // halfway
    expect_vec(eyes[3 * film_fps]!.position, [0, 0, 4]);
    expect_vec(eyes[eyes.length - 1]!.position, [0, 0, 4]);
  });

  it('ends, whatever the tour', () => {
    const endless = tour_of(...Array.from({ length: 10 }, (_, i) => stop(i, 3600, 1)));
    expect(film_eyes(endless, 5).length).toBe(most_film_frames);
    expect(film_eyes(tour_of(), 5)).toEqual([]);
  });

  it('is written shortly: what stays is a number', () => {
    const views = write_views(film_eyes(tour_of(stop(0, 1, 0), stop(4, 1, 0)), 5));
    expect(views).toEqual([[0, 0, 0, 0, 0, 0, 1, 60], 29, [0, 0, 4, 0, 0, 0, 1, 60], 29]);
    // Ten minutes of flight fit into an upload.
    const far = tour_of(...Array.from({ length: 6 }, (_, i) => stop(i * 123.456, 0, 120)));
    const text = JSON.stringify({
      kind: 'film',
      size: [1920, 1080],
      views: write_views(film_eyes(far, 5)),
    });
    expect(text.length).toBeLessThan(2 << 20);
  });

  it('is written as a trace of the command line, too', () => {
    const lines = write_tum(film_eyes(tour_of(stop(2, 1, 0)), 5))
      .trimEnd()
      .split('\n');
    expect(lines.length).toBe(film_fps);
    expect(lines[1]).toBe(
      '0.033333 0.0000000 0.0000000 2.0000000 0.0000000 0.0000000 0.0000000 1.0000000',
    );
  });
});
