// The eyes of a headset, and the stream that the server has to draw for them. Pure.
import { add, conjugate, rotate, scale, sub, type Vec3 } from '../base/vector';
import type { Pose } from '../camera/eye';
import {
  along_axes_of,
  aspect_of,
  frustum_of,
  frustum_of_eye,
  widened_frustum,
  type Frustum,
  type FrustumView,
} from '../present/frustum';
import type { Sides } from '../present/warp';
import { eye_of_frame } from '../session/camera_messages';
import type { FrameHeader } from '../wire/wire';
import type { HeadsetStream } from '../worker/headset';
import { pose_in_room } from './rig';

/** The parts of XRView and XRViewerPose that this file uses. */
interface View {
  readonly eye: string;
  readonly projectionMatrix: ArrayLike<number>;
  readonly transform: Parameters<typeof pose_in_room>[0];
}
interface Viewer<V extends View> {
  readonly transform: View['transform'];
  readonly views: readonly V[];
}

export interface EyeOfHead<V extends View = View> {
  readonly view: V;
  /** Half of the picture that it sees: 0 is the left one. */
  readonly half: 0 | 1;
  /** In the room. */
  readonly pose: Pose;
  /** Along its own axes. */
  readonly frustum: Frustum;
  /** Along the axes of the head: contains the other one. */
  readonly parallel: Frustum;
  /** From the head, in the axes of the head, metres. */
  readonly offset: Vec3;
}

export interface Head<V extends View = View> {
  /** In the room: the middle of the eyes. */
  readonly pose: Pose;
  readonly eyes: readonly EyeOfHead<V>[];
}

export function head_of<V extends View>({ transform, views }: Viewer<V>): Head<V> {
  const { orientation } = pose_in_room(transform);
  const poses = views.map((view) => pose_in_room(view.transform));
  const position = scale(
    poses.map((pose) => pose.position).reduce(add, [0, 0, 0]),
    1 / Math.max(1, poses.length),
  );
  const eyes = views.map((view, i): EyeOfHead<V> => {
    const pose = poses[i]!;
    const frustum = frustum_of(view.projectionMatrix);
    return {
      view,
      half: view.eye === 'right' ? 1 : 0,
      pose,
      frustum,
      parallel: along_axes_of(orientation, pose.orientation, frustum),
      offset: rotate(conjugate(orientation), sub(pose.position, position)),
    };
  });
  return { pose: { position, orientation }, eyes };
}

interface Wanted {
  /** Sides of pictures over those of the view. */
  readonly overscan: Sides;
  /** Of what one eye sees; with overscan, the picture is higher. */
  readonly height_px: number;
  /** The longest side of a picture. */
  readonly most_px: number;
  readonly rate_hz: number;
  readonly units_per_metre: number;
}

const even = (px: number): number => 2 * Math.max(8, Math.round(px / 2));

/** What to ask the server for. Undefined: the headset has no eyes now. */
export function stream_for(head: Head, wanted: Wanted): HeadsetStream | undefined {
  const left = head.eyes.find(({ half }) => half === 0) ?? head.eyes[0];
  const right = head.eyes.find(({ half }) => half === 1) ?? left;
  if (!left || !right) return undefined;
  const { overscan, height_px, most_px, rate_hz, units_per_metre } = wanted;
  const eye_message = ({ offset, parallel }: EyeOfHead) => ({
    rightOfPose: offset[0] * units_per_metre,
    belowPose: offset[1] * units_per_metre,
    ...widened_frustum(parallel, overscan),
  });
  const stereo = { left: eye_message(left), right: eye_message(right) };
  const aspect = Math.max(aspect_of(stereo.left), aspect_of(stereo.right));
  const tall = height_px * overscan.y;
  const fit = Math.min(1, most_px / (2 * tall * aspect), most_px / tall);
  const [widthPx, heightPx] = [2 * even(tall * aspect * fit), even(tall * fit)];
  // A server that draws one eye draws this size: its view has to hold what both eyes see.
  const all = [stereo.left, stereo.right];
  const across = Math.max(...all.flatMap(({ left: a, right: b }) => [-a, b]));
  const along = Math.max(...all.flatMap(({ up, down }) => [-up, down]));
  return {
    settings: {
      widthPx,
      heightPx,
      stillWidthPx: widthPx,
      stillHeightPx: heightPx,
      maxFps: Math.round(rate_hz),
      depths: true,
      stereo,
    },
    fov_y_rad: 2 * Math.atan(Math.max(along, (across * heightPx) / widthPx)),
  };
}

const same_offset_m = 5e-4; // headsets measure the distance of the eyes again and again
const same_tangent = 1e-3;

/** Whether the server need not hear of the newer one. */
export function same_stream(
  a: HeadsetStream | undefined,
  b: HeadsetStream | undefined,
  units_per_metre: number,
): boolean {
  if (!a || !b) return a === b;
  for (const side of ['left', 'right'] as const) {
    const [x, y] = [a.settings.stereo?.[side], b.settings.stereo?.[side]];
    if (!x || !y) return false;
    const near = (field: keyof Frustum | 'rightOfPose' | 'belowPose', most: number): boolean =>
      Math.abs((x[field] ?? 0) - (y[field] ?? 0)) <= most;
    const offsets = ['rightOfPose', 'belowPose'] as const;
    const sides = ['left', 'right', 'up', 'down'] as const;
    if (!offsets.every((field) => near(field, same_offset_m * units_per_metre))) return false;
    if (!sides.every((field) => near(field, same_tangent))) return false;
  }
  const fields = ['widthPx', 'heightPx', 'maxFps'] as const;
  return fields.every((field) => a.settings[field] === b.settings[field]);
}

/** The part of a picture that an eye sees, and its camera; `camera`: that of the frame, in any coordinates. */
export function picture_for(half: 0 | 1, header: FrameHeader, camera: Pose): FrustumView {
  const { stereo } = header;
  const eye = half === 0 ? stereo?.left : stereo?.right;
  if (!eye) {
    const aspect = header.widthPx / Math.max(1, header.heightPx);
    return { ...camera, frustum: frustum_of_eye(eye_of_frame(header), aspect) };
  }
  const { position, orientation } = camera;
  const offset = rotate(orientation, [eye.rightOfPose, eye.belowPose, 0]);
  const { left, right, up, down } = eye;
  return { position: add(position, offset), orientation, frustum: { left, right, up, down } };
}

const least_hz = 72; // slower refreshes make many visitors sick
/** The slowest refresh that is smooth and shows every picture of the server; undefined: the headset leaves no choice. */
export function rate_for(
  supported_hz: ArrayLike<number> | undefined,
  server_fps: number,
): number | undefined {
  const rates = Array.from(supported_hz ?? []).sort((a, b) => a - b);
  return rates.find((rate) => rate >= Math.max(least_hz, server_fps) - 0.5) ?? rates.at(-1);
}

const assumed_eye_height_m = 1.6;
const assumed_reach_m = 7; // who walks 0.25 of it a second has the speed of people who walk

/** How large a metre of the visitor is. `eye_height`: of who walks, world units. */
export const units_per_metre_of = (
  metres_per_unit: number | undefined,
  eye_height: number | undefined,
  reach: number,
): number =>
  metres_per_unit
    ? 1 / metres_per_unit
    : eye_height
      ? eye_height / assumed_eye_height_m
      : reach / assumed_reach_m;
