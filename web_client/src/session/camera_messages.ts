// Converts cameras and scenes between the client and the wire.
import { add, dot, scale, sub, type Vec3 } from '../base/vector';
import type { Clip, Eye, Pose } from '../camera/eye';
import { camera_modes, type CameraMode } from '../camera/mode';
import type { Ray } from '../camera/ray';
import type { SceneSetup } from '../camera/scene_setup';
import type { ClipInit, FrameHeader, PoseInit, SceneFacts } from '../wire/wire';

type WireVector = Pick<NonNullable<SceneFacts['up']>, 'x' | 'y' | 'z'>;
type WirePose = NonNullable<FrameHeader['renderPose']>;

export function pose_message(
  pose_id: number,
  time_us: number,
  eye: Eye,
  at_rest = false,
): PoseInit {
  return {
    poseId: BigInt(pose_id),
    clientTimeUs: BigInt(Math.round(time_us)),
    worldFromCamera: wire_pose(eye),
    fovYRad: eye.fov_y_rad,
    atRest: at_rest,
    ...(eye.view_height !== undefined && { viewHeight: eye.view_height }),
  };
}

function wire_pose({ position, orientation: [x, y, z, w] }: Pose): {
  position: ReturnType<typeof wire_vector>;
  orientation: { x: number; y: number; z: number; w: number };
} {
  return { position: wire_vector(position), orientation: { x, y, z, w } };
}

export const wire_vector = ([x, y, z]: Vec3): { x: number; y: number; z: number } => ({ x, y, z });

// Fields that a server leaves out read as zeros. The defaults here make a usable pose and scene of them.
export const vector_of = (v: WireVector | undefined): Vec3 => [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0];

export function eye_of(pose: WirePose | undefined, fov_y_rad: number, view_height = 0): Eye {
  const q = pose?.orientation;
  return {
    position: vector_of(pose?.position),
    orientation: [q?.x ?? 0, q?.y ?? 0, q?.z ?? 0, q?.w ?? 1],
    fov_y_rad,
    ...(view_height > 0 && { view_height }),
  };
}

/** The camera of a picture. */
export const eye_of_frame = ({ renderPose, fovYRad, viewHeight }: FrameHeader): Eye =>
  eye_of(renderPose, fovYRad, viewHeight);

/** The same pose about another point than 0; `by` leads from there to 0. */
const moved_by = <T extends Pose>(pose: T, by: Vec3): T => ({
  ...pose,
  position: add(pose.position, by),
});

/** Between the page, which has the coordinates of the scene's file, and the wire, which is about the scene's origin. */
export class SceneCoordinates {
  private readonly origin_: Vec3;

  constructor(scene?: SceneFacts) {
    this.origin_ = vector_of(scene?.origin);
  }

  readonly point_message = (point: Vec3): ReturnType<typeof wire_vector> =>
    wire_vector(sub(point, this.origin_));

  readonly point_of = (v: WireVector): Vec3 => add(vector_of(v), this.origin_);

  to_scene<T extends Pose>(pose: T): T {
    return moved_by(pose, scale(this.origin_, -1));
  }

  to_file<T extends Pose>(pose: T): T {
    return moved_by(pose, this.origin_);
  }

  header_in_file(header: FrameHeader): FrameHeader {
    const { renderPose: pose } = header;
    if (!pose?.position) return header;
    const at = wire_vector(this.point_of(pose.position));
    return { ...header, renderPose: { ...pose, position: { ...pose.position, ...at } } };
  }

  ray_message({ origin, direction }: Ray): Record<keyof Ray, ReturnType<typeof wire_vector>> {
    return { origin: this.point_message(origin), direction: wire_vector(direction) };
  }

  clip_message(clip: Clip | undefined): ClipInit {
    if (!clip) return {};
    if ('normal' in clip) {
      const offset = clip.offset - dot(clip.normal, this.origin_);
      return { normal: wire_vector(clip.normal), offset };
    }
    const worldFromBox = wire_pose(this.to_scene(clip.world_from_box));
    return { box: { worldFromBox, halfExtent: wire_vector(clip.half_extent) } };
  }
}

/** Numbers on the wire count from 1. */
export const show_message = ({
  tour_index = -1,
  stop_index = -1,
  arrived,
}: {
  readonly tour_index: number | undefined;
  readonly stop_index: number | undefined;
  readonly arrived: boolean;
}): { tour: number; stop: number; arrived: boolean } => ({
  tour: tour_index + 1,
  stop: stop_index + 1,
  arrived,
});

export function scene_setup(scene: SceneFacts): SceneSetup {
  const origin = vector_of(scene.origin);
  const position_of = (v: WireVector | undefined): Vec3 => add(vector_of(v), origin);
  const { orientation } = eye_of(scene.startPose, 0);
  return {
    origin,
    up: vector_of(scene.up),
    start_pose: { position: position_of(scene.startPose?.position), orientation },
    focus: position_of(scene.focus),
    limits_min: position_of(scene.limitsMin),
    limits_max: position_of(scene.limitsMax),
    content: scene.contentMin && {
      min: position_of(scene.contentMin),
      max: position_of(scene.contentMax),
    },
    near_z: scene.nearZ,
    scale: scene.scale,
    enclosed: scene.startEnclosed,
  };
}

/** How a visitor moves at first; undefined: the scene does not say. The wire counts the modes from 1. */
export const start_mode = ({ mode }: SceneFacts): CameraMode | undefined => camera_modes[mode - 1];
