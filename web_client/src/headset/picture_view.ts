// Draws the newest picture as each eye sees it now: a mesh by its depths, or a plane in the far field.
import { MeshProgram, placed_mesh, unpack_depths, type TexturePart } from '../present/depth_mesh';
import { frustum_warp, type Frustum, type FrustumView } from '../present/frustum';
import type { Depths } from '../present/presenter';
import type { Pose } from '../camera/eye';
import type { HeadsetPicture } from '../worker/headset';
import { picture_for } from './eyes';

const picture_ends = 1; // beyond it nothing is drawn
const far: Depths = {
  columns: 1,
  rows: 1,
  inverse_depths: new Float32Array(1),
  distance: Infinity,
  nearest: 0,
};

interface HalfPicture {
  readonly camera: FrustumView;
  readonly depths: Depths;
  readonly part: TexturePart;
}

/** Columns of a grid of both eyes that show one of them. */
function half_of(depths: Depths, half: 0 | 1): Depths {
  const columns = depths.columns >> 1;
  const inverse_depths = new Float32Array(columns * depths.rows);
  for (let row = 0; row < depths.rows; ++row) {
    const begin = row * depths.columns + half * columns;
    inverse_depths.set(depths.inverse_depths.subarray(begin, begin + columns), row * columns);
  }
  return { ...depths, columns, inverse_depths };
}

function halves_of({ header, eye }: HeadsetPicture): readonly [HalfPicture, HalfPicture] {
  const depths = unpack_depths(header);
  const is_stereo = header.stereo !== undefined;
  const half = (side: 0 | 1): HalfPicture => {
    const width = header.widthPx / (is_stereo ? 2 : 1);
    return {
      camera: picture_for(side, header, eye),
      depths: !depths ? far : is_stereo ? half_of(depths, side) : depths,
      part: {
        half: [is_stereo ? 0.25 : 0.5, 0.5],
        middle: [is_stereo ? 0.25 + side / 2 : 0.5, 0.5],
        // Beyond the middle of the outermost pixel the other eye would show through.
        most: [1 - 1 / width, 1 - 1 / header.heightPx],
      },
    };
  };
  return [half(0), half(1)];
}

export class PictureView {
  private readonly program_: MeshProgram;
  private readonly texture_: WebGLTexture;
  private halves_: readonly [HalfPicture, HalfPicture] | undefined;

  constructor(private readonly gl_: WebGL2RenderingContext) {
    const gl = gl_;
    this.program_ = new MeshProgram(gl);
    this.texture_ = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.texture_);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T])
      gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
      gl.texParameteri(gl.TEXTURE_2D, filter, gl.LINEAR);
  }

  show(shown: HeadsetPicture): void {
    const gl = this.gl_;
    gl.bindTexture(gl.TEXTURE_2D, this.texture_);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, shown.picture);
    this.halves_ = halves_of(shown);
  }

  /** Shows nothing until there is another picture, and keeps no memory for it. */
  clear(): void {
    const gl = this.gl_;
    this.halves_ = undefined;
    gl.bindTexture(gl.TEXTURE_2D, this.texture_);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
  }

  /** What an eye sees the picture from; undefined: there is none yet. */
  camera_of(half: 0 | 1): (FrustumView & { readonly distance: number }) | undefined {
    const shown = this.halves_?.[half];
    return shown && { ...shown.camera, distance: shown.depths.distance };
  }

  /** Into the viewport of an eye, which is at `pose` in the world. */
  draw(half: 0 | 1, pose: Pose, frustum: Frustum): void {
    const shown = this.halves_?.[half];
    if (!shown) return;
    const gl = this.gl_;
    const view = { ...pose, frustum };
    const points = placed_mesh(
      shown.depths,
      (distance) => frustum_warp(view, shown.camera, distance),
      picture_ends,
    );
    gl.bindTexture(gl.TEXTURE_2D, this.texture_);
    this.program_.draw(shown.depths, points, shown.part);
  }
}
