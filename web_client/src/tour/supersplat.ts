// Reads the settings.json of the SuperSplat viewer, version 2: cameras, animTracks, annotations.
import { look_at, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { text } from '../text/text';
import { film_flight, type Shot } from './camera_spline';
import { JsonField } from './json_field';
import type { Stop, Tour } from './tour';
import { untranslated } from './words';

interface ImportedTours {
  readonly tours: readonly Tour[];
  /** Where a visit begins. */
  readonly start: Eye | undefined;
}

const { mistakes } = text;
const most_entries = 1024;
const loops = ['none', 'repeat', 'pingpong'] as const;

/** The y axis of captures points down. SuperSplat turns them by half a turn about z. */
const to_scene = ([x, y, z]: Vec3): Vec3 => [-x, -y, z];
const up: Vec3 = [0, -1, 0]; // its +y

/** Fields of view in the file are degrees of the longer side of the view. */
function vertical_fov(fov: JsonField, aspect: number): number {
  const longer = Math.tan((fov.number(1, 170) * Math.PI) / 360);
  return 2 * Math.atan(longer / Math.max(1, aspect));
}

function read_camera(camera: JsonField, aspect: number): Eye {
  const pose = camera.at('initial');
  const position = to_scene(pose.at('position').vec3());
  return {
    position,
    orientation: look_at(position, to_scene(pose.at('target').vec3()), up),
    fov_y_rad: vertical_fov(pose.at('fov'), aspect),
  };
}

function read_annotation(annotation: JsonField, aspect: number): Stop {
  return {
    title: annotation.at('title').text(),
    caption: annotation.find('text')?.text() ?? '',
    ...untranslated,
    eye: read_camera(annotation.at('camera'), aspect),
    marker: to_scene(annotation.at('position').vec3()),
    stay_s: undefined,
    fly_s: undefined,
    portal: undefined,
  };
}

function read_track(track: JsonField, aspect: number, starts_itself: boolean): Tour | undefined {
  const rate = track.at('frameRate').number(0.001, 10_000);
  const frames = track.at('keyframes').at('times').elements(most_entries);
  if (frames.length === 0) return undefined;
  const times_s = frames.map((frame) => frame.number(0) / rate);
  if (times_s.some((time_s, i) => i > 0 && time_s <= times_s[i - 1]!)) {
    track.at('keyframes').at('times').fail(mistakes.not_increasing);
  }
  const values = track.at('keyframes').at('values');
  const positions = values.at('position').elements(3 * most_entries);
  const targets = values.at('target').elements(3 * most_entries);
  const fovs = values.at('fov').elements(most_entries);
  if (positions.length !== 3 * frames.length || targets.length !== 3 * frames.length) {
    values.fail(mistakes.not_three_each);
  }
  if (fovs.length !== frames.length) values.fail(mistakes.not_one_each);
  const triple = (list: JsonField[], i: number): Vec3 =>
    to_scene([list[3 * i]!.number(), list[3 * i + 1]!.number(), list[3 * i + 2]!.number()]);
  const shots = frames.map(
    (_, i): Shot => ({
      position: triple(positions, i),
      target: triple(targets, i),
      fov_y_rad: vertical_fov(fovs[i]!, aspect),
    }),
  );
  const loop = loops.find((kind) => kind === track.find('loopMode')?.text()) ?? 'none';
  const way = film_flight(
    {
      times_s,
      shots,
      duration_s: Math.max(track.at('duration').number(0, 1e5), times_s[times_s.length - 1]!),
      smoothness: track.find('smoothness')?.number(0, 1) ?? 1,
      steps: track.find('interpolation')?.text() === 'step',
      loop,
    },
    up,
  );
  return {
    title: track.find('name')?.text() ?? '',
    ...untranslated,
    stops: [],
    way,
    starts_itself,
  };
}

/** Throws an error that names the field it cannot read. `aspect`: width over height of the view. */
export function read_supersplat(document: unknown, aspect: number): ImportedTours {
  const settings = new JsonField('settings.json', document);
  const version = settings.find('version')?.number();
  if (version !== 2) settings.fail(mistakes.version({ found: String(version ?? 1), read: '2' }));
  const mode = settings.find('startMode')?.text() ?? 'default';
  const list = (key: string): JsonField[] => settings.find(key)?.elements(most_entries) ?? [];

  const stops = list('annotations').map((entry) => read_annotation(entry, aspect));
  const films = list('animTracks').flatMap((track, i) => {
    return read_track(track, aspect, mode === 'animTrack' && i === 0) ?? [];
  });
  const annotated: Tour[] =
    stops.length > 0
      ? [{ title: '', ...untranslated, stops, way: undefined, starts_itself: false }]
      : [];
  const camera = list('cameras')[0];
  const first = mode === 'annotation' ? stops[0]?.eye : undefined;
  return {
    tours: [...annotated, ...films],
    start: first ?? (camera && read_camera(camera, aspect)),
  };
}
