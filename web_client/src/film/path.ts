// The camera of a film, frame by frame, as the page plays a tour. Pure.
import { short_coordinate } from '../base/vector';
import type { Eye } from '../camera/eye';
import type { Flight } from '../camera/flight';
import { default_stay_s, flight_to, type Tour } from '../tour/tour';

export const film_fps = 30; // as server/films/film_request.h has it
export const most_film_frames = 18_000;

/** What a tour does, part after part. `reach`: the scene's scale to a visitor, world units. */
function parts_of({ stops, way }: Tour, reach: number): readonly Flight[] {
  if (way) return [way];
  return stops.flatMap((stop, i) => {
    const stay = { duration_s: stop.stay_s ?? default_stay_s(stop), at: () => stop.eye };
    return i === 0 ? [stay] : [flight_to(stop, stops[i - 1]!.eye, reach), stay];
  });
}

export const film_length_s = (tour: Tour, reach: number): number =>
  parts_of(tour, reach).reduce((sum, { duration_s }) => sum + duration_s, 0);

/** The camera of each frame, of so many at most. */
export function film_eyes(tour: Tour, reach: number): readonly Eye[] {
  const eyes: Eye[] = [];
  let begin_s = 0;
  for (const part of parts_of(tour, reach)) {
    const end_s = begin_s + part.duration_s;
    while (eyes.length < most_film_frames && eyes.length / film_fps < end_s) {
      eyes.push(part.at(eyes.length / film_fps - begin_s));
    }
    begin_s = end_s;
  }
  return eyes;
}

/** As the server reads them: a number in place of a view repeats the one before. */
export function write_views(eyes: readonly Eye[]): (readonly number[] | number)[] {
  const views: (readonly number[] | number)[] = [];
  let last = '';
  for (const { position, orientation, fov_y_rad, view_height } of eyes) {
    const view = [
      ...position.map((v) => short_coordinate(v, 7)),
      ...orientation.map((v) => Number(v.toFixed(6))),
      Number(((fov_y_rad * 180) / Math.PI).toFixed(3)),
      ...(view_height ? [short_coordinate(view_height, 7)] : []),
    ];
    const written = view.join(' ');
    const before = views[views.length - 1];
    if (written !== last) views.push(view);
    else if (typeof before === 'number') views[views.length - 1] = before + 1;
    else views.push(1);
    last = written;
  }
  return views;
}

/** A TUM file, for `catgs-render frames --trace`: time, position and orientation, a line for each frame. */
export const write_tum = (eyes: readonly Eye[]): string =>
  eyes
    .map(({ position, orientation }, i) =>
      [(i / film_fps).toFixed(6), ...[...position, ...orientation].map((v) => v.toFixed(7))].join(
        ' ',
      ),
    )
    .join('\n')
    .concat('\n');
