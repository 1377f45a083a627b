// Tours through a scene: stops to visit, or a film of the camera. Pure.
import { look_at, short_coordinate, type Quat, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { glide, glide_time_s, type Flight } from '../camera/flight';
import type { Section } from '../camera/section';
import { text } from '../text/text';
import { in_language, write_translations } from '../text/translations';
import { JsonField } from './json_field';
import { longest_flight_s, longest_stay_s, max_stops, max_tours } from './limits';
import {
  read_media,
  read_narration,
  read_tour_sound,
  write_media,
  write_narration,
  write_tour_sound,
  type Medium,
  type Narration,
  type TourSound,
} from './media';
import { read_translations, untranslated, type Worded } from './words';

/** A way into another scene: to a view of it, to a stop of one of its tours, or to where visits begin there. */
export interface Portal {
  /** Its id or name. */
  readonly scene: string;
  readonly view:
    | {
        readonly position: Vec3;
        /** The point that is looked at with the up of that scene, or an orientation. */
        readonly look_at: Vec3 | undefined;
        readonly orientation: Quat | undefined;
        readonly fov_y_rad: number | undefined;
      }
    | undefined;
  readonly tour_index: number | undefined;
  readonly stop_index: number | undefined;
}

export interface Stop extends Worded {
  readonly caption: string;
  readonly eye: Eye;
  /** What is drawn there; undefined: all. */
  readonly section?: Section | undefined;
  /** Place of its hotspot in the scene; undefined: it has none. */
  readonly marker: Vec3 | undefined;
  /** Time that autoplay stays; undefined: as long as the caption takes to read. */
  readonly stay_s: number | undefined;
  /** Time of the flight to it; undefined: a comfortable one. */
  readonly fly_s: number | undefined;
  readonly media?: readonly Medium[] | undefined;
  readonly narration?: Narration | undefined;
  readonly portal: Portal | undefined;
}

export interface Tour extends Worded {
  readonly stops: readonly Stop[];
  /** A film of the camera, instead of stops. */
  readonly way: (Flight & { readonly repeats: boolean }) | undefined;
  /** Plays by itself when the scene opens. */
  readonly starts_itself: boolean;
  readonly sound?: TourSound | undefined;
}

/** Whether a tour shows or plays more than words. */
export const has_media = ({ sound, stops }: Tour): boolean =>
  sound !== undefined ||
  stops.some(({ media, narration }) => narration !== undefined || (media ?? []).length > 0);

/** Time that a visitor needs to look around and to read. */
export function default_stay_s(stop: Stop): number {
  return 3 + 0.06 * (stop.caption.length + stop.title.length);
}

/** The flight to a stop. `reach`: the scene's scale to a visitor, world units. */
export const flight_to = (stop: Stop, from: Eye, reach: number): Flight =>
  glide(from, stop.eye, stop.fly_s ?? glide_time_s(from, stop.eye, reach));

/**
 * Reads `tours` of a sidecar (TOURS.md). Throws an error that names the wrong field. `up`: that of the
 * scene. `fov_y_rad`: for stops that give none.
 */
export function read_tours(document: unknown, up: Vec3, fov_y_rad: number): Tour[] {
  return new JsonField('tours', document).elements(max_tours).map((tour) => ({
    title: tour.find('title')?.text() ?? '',
    ...read_words(tour),
    stops: tour
      .at('stops')
      .elements(max_stops)
      .map((stop) => read_stop(stop, up, fov_y_rad)),
    way: undefined,
    starts_itself: tour.find('autoplay')?.truth() ?? false,
    sound: read_tour_sound(tour.find('sound')),
  }));
}

function read_stop(stop: JsonField, up: Vec3, fov_y_rad: number): Stop {
  const position = stop.at('position').vec3();
  const target = stop.find('look_at')?.vec3();
  const orientation = target ? look_at(position, target, up) : orientation_of(stop);
  return {
    title: stop.find('title')?.text() ?? '',
    caption: stop.find('caption')?.text() ?? '',
    ...read_words(stop),
    eye: {
      position,
      orientation,
      fov_y_rad: stop.find('fov_deg')?.fov_rad() ?? fov_y_rad,
      view_height: stop.find('view_height')?.number(1e-6),
    },
    section: stop.find('section')?.section(),
    marker: stop.find('marker')?.vec3(),
    stay_s: stop.find('stay_s')?.number(0, longest_stay_s),
    fly_s: stop.find('fly_s')?.number(0, longest_flight_s),
    media: read_media(stop.find('media')),
    narration: read_narration(stop.find('narration')),
    portal: read_portal(stop.find('portal')),
  };
}

/** For views without `look_at`. */
const orientation_of = (field: JsonField): Quat =>
  (
    field.find('orientation') ??
    field.fail(text.mistakes.missing_both({ one: 'look_at', other: 'orientation' }))
  ).orientation();

function read_portal(portal: JsonField | undefined): Portal | undefined {
  if (!portal) return undefined;
  const position = portal.find('position')?.vec3();
  const target = portal.find('look_at')?.vec3();
  return {
    scene: portal.at('scene').text(),
    view: position && {
      position,
      look_at: target,
      orientation: target ? undefined : orientation_of(portal),
      fov_y_rad: portal.find('fov_deg')?.fov_rad(),
    },
    tour_index: portal.find('tour')?.ordinal(max_tours),
    stop_index: portal.find('stop')?.ordinal(max_stops),
  };
}

export const read_words = (item: JsonField): Pick<Worded, 'translations' | 'language'> => ({
  ...untranslated,
  translations: read_translations(item, (words) => ({
    title: words.find('title')?.text() ?? '',
    caption: words.find('caption')?.text() ?? '',
  })),
});

/** The tours as a visitor reads and hears them, in the first of these languages that each part has. */
export const tours_for = (tours: readonly Tour[], readers: readonly string[]): readonly Tour[] =>
  tours.map((tour) => ({
    ...in_language(tour, readers),
    sound: tour.sound && in_language(tour.sound, readers),
    stops: tour.stops.map((stop) => ({
      ...in_language(stop, readers),
      media: stop.media?.map((medium) => in_language(medium, readers)),
      narration: stop.narration && in_language(stop.narration, readers),
    })),
  }));

const short = (v: number): number => short_coordinate(v, 7);
const degrees = (angle_rad: number): number => short((angle_rad * 180) / Math.PI);

/** Writes what read_tours() reads. Numbers keep seven digits, or four decimals: more than anybody can see. */
export function write_tours(tours: readonly Tour[]): unknown[] {
  return tours
    .filter(({ way }) => way === undefined)
    .map(({ title, translations, stops, starts_itself, sound }) => ({
      title,
      ...write_translations(translations),
      ...(starts_itself && { autoplay: true }),
      ...(sound && { sound: write_tour_sound(sound) }),
      stops: stops.map((stop) => ({
        title: stop.title,
        ...(stop.caption && { caption: stop.caption }),
        ...write_translations(stop.translations),
        position: stop.eye.position.map(short),
        orientation: stop.eye.orientation.map(short),
        fov_deg: degrees(stop.eye.fov_y_rad),
        ...(stop.eye.view_height && { view_height: short(stop.eye.view_height) }),
        ...(stop.section && { section: stop.section.map(short) }),
        ...(stop.marker && { marker: stop.marker.map(short) }),
        ...(stop.stay_s !== undefined && { stay_s: stop.stay_s }),
        ...(stop.fly_s !== undefined && { fly_s: stop.fly_s }),
        ...(stop.media && stop.media.length > 0 && { media: write_media(stop.media) }),
        ...(stop.narration && { narration: write_narration(stop.narration) }),
        ...(stop.portal && { portal: write_portal(stop.portal) }),
      })),
    }));
}

function write_portal({ scene, view, tour_index, stop_index }: Portal): object {
  return {
    scene,
    ...(view && {
      position: view.position.map(short),
      ...(view.look_at && { look_at: view.look_at.map(short) }),
      ...(view.orientation && { orientation: view.orientation.map(short) }),
      ...(view.fov_y_rad !== undefined && { fov_deg: degrees(view.fov_y_rad) }),
    }),
    ...(tour_index !== undefined && { tour: tour_index + 1 }),
    ...(stop_index !== undefined && { stop: stop_index + 1 }),
  };
}
