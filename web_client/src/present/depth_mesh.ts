// Warps a picture by its depths: a mesh over it, whose points move by their inverse depths.
// tests/load/depth_warp.cpp repeats it for benchmarks. Loaded once pictures are warped.
import { inflateSync } from 'fflate';
import type { Eye } from '../camera/eye';
import type { FrameHeader } from '../wire/wire';
import type { Depths, Surface } from './presenter';
import { warp_matrix, type Matrix3 } from './warp';

const most_cells = 128; // a side
const mesh_reach = 4; // how far beyond the picture's middle the mesh reaches
const point_size = 6; // floats

/** What its neighbours let expect of a cell: JPEG-LS (ITU-T T.87, A.4.2). */
function expected(codes: Uint8Array, columns: number, x: number, i: number): number {
  const above = codes[i - columns];
  if (above === undefined) return x === 0 ? 0 : codes[i - 1]!;
  if (x === 0) return above;
  const [left, corner] = [codes[i - 1]!, codes[i - columns - 1]!];
  const [low, high] = [Math.min(left, above), Math.max(left, above)];
  return Math.max(low, Math.min(high, left + above - corner));
}

/** The fields of a frame that have its depth grid (proto/README.md). */
export type DepthFields = Pick<
  FrameHeader,
  'depthColumns' | 'depthRows' | 'depthScale' | 'depthCodes'
>;

/** Unpacks the grid of a frame. Undefined where there is none. */
export function unpack_depths({
  depthColumns: columns,
  depthRows: rows,
  depthScale: scale,
  depthCodes: packed,
}: DepthFields): Depths | undefined {
  if (!(columns > 0 && rows > 0 && columns <= most_cells && rows <= most_cells)) return undefined;
  if (!(scale >= 0 && Number.isFinite(Math.fround(scale * 255 * 255)))) return undefined;
  const count = columns * rows;
  let codes;
  try {
    // One byte more, so that a grid that is too large shows.
    codes = inflateSync(packed, { out: new Uint8Array(count + 1) });
  } catch {
    return undefined;
  }
  if (codes.length !== count) return undefined;
  const inverse_depths = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    const code = (codes[i]! + expected(codes, columns, i % columns, i)) & 255;
    codes[i] = code;
    inverse_depths[i] = scale * code * code;
  }
  const sorted = inverse_depths.slice().sort();
  return {
    columns,
    rows,
    inverse_depths,
    distance: 1 / sorted[count >> 1]!,
    nearest: sorted[count - 1]!,
  };
}

/**
 * A point in the middle of each cell, and a frame of points around them with the inverse depths of the
 * outermost cells, by rows. A point is its place in the view, homogeneous, with its view depth times
 * its inverse depth as third; its inverse depth; and its place in the picture.
 */
export const mesh_points = (
  depths: Depths,
  picture: Eye,
  view: Eye,
  aspect: number,
  view_aspect: number,
): Float32Array =>
  placed_mesh(depths, (distance) => warp_matrix(view, picture, view_aspect, distance, aspect));

/**
 * The same for any pair of picture and view. `view_from_picture`: the homography of the plane at this distance
 * ahead of the picture. `reach`: where the frame of points is; the picture ends at 1.
 */
export function placed_mesh(
  { columns, rows, inverse_depths }: Depths,
  view_from_picture: (distance: number) => Matrix3,
  reach = mesh_reach,
): Float32Array {
  const far = view_from_picture(Infinity);
  const near = view_from_picture(1);
  const place = (cell: number, cells: number): number =>
    cell < 0 ? -reach : cell < cells ? (2 * cell + 1) / cells - 1 : reach;
  const inside = (cell: number, cells: number): number => Math.max(0, Math.min(cell, cells - 1));
  const points = new Float32Array((columns + 2) * (rows + 2) * point_size);
  let at = 0;
  for (let row = -1; row <= rows; ++row) {
    for (let column = -1; column <= columns; ++column) {
      const [u, v] = [place(column, columns), place(row, rows)];
      const inverse_depth = inverse_depths[inside(row, rows) * columns + inside(column, columns)]!;
      for (let i = 0; i < 3; ++i) {
        const shift = near[6 + i]! - far[6 + i]!;
        points[at++] = far[i]! * u + far[3 + i]! * v + far[6 + i]! + inverse_depth * shift;
      }
      points[at++] = inverse_depth;
      points[at++] = u;
      points[at++] = v;
    }
  }
  return points;
}

/** Two triangles between each four points. */
export function mesh_triangles(columns: number, rows: number): Uint16Array {
  const stride = columns + 2;
  const triangles = [];
  for (let row = 0; row <= rows; ++row) {
    for (let column = 0; column <= columns; ++column) {
      const a = row * stride + column;
      triangles.push(a, a + 1, a + stride, a + 1, a + stride + 1, a + stride);
    }
  }
  return new Uint16Array(triangles);
}

// The depth buffer has 1 less the inverse depth of the view, times `nearness`.
const vertex_source = `#version 300 es
uniform float nearness;
layout(location = 0) in vec4 place;
layout(location = 1) in vec2 in_picture;
out highp vec2 point;
void main() {
  point = in_picture;
  gl_Position = vec4(place.x, -place.y, place.z - nearness * place.w, place.z);
}`;

const fragment_source = `#version 300 es
precision mediump float;
uniform sampler2D picture;
uniform highp vec4 part;
uniform highp vec2 most;
in highp vec2 point;
out vec4 colour;
void main() {
  colour = vec4(texture(picture, part.zw + part.xy * clamp(point, -most, most)).rgb, 1.0);
}`;

const near_share = 0.01; // surfaces this much nearer than the nearest one still show

/** The part of a texture that is the picture. */
export interface TexturePart {
  /** Half of its size, and its middle, as shares of the texture. */
  readonly half: readonly [x: number, y: number];
  readonly middle: readonly [x: number, y: number];
  /** The outermost points that may be read; the picture ends at 1. */
  readonly most: readonly [x: number, y: number];
}

const all_of_it: TexturePart = {
  half: [0.5, 0.5],
  middle: [0.5, 0.5],
  most: [mesh_reach, mesh_reach], // the texture repeats its border
};

/** Throws where the shaders are wrong. While the context is lost, the program draws nothing. */
export function linked_program(
  gl: WebGL2RenderingContext,
  name: string,
  vertex: string,
  fragment: string,
): WebGLProgram {
  const program = gl.createProgram();
  for (const [type, source] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ] as const) {
    const shader = gl.createShader(type);
    if (!shader) continue; // only while the context is lost
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error(`${name} shader: ${gl.getProgramInfoLog(program) ?? ''}`);
  return program;
}

/** Draws meshes with one context. The texture that is bound there is the picture. */
export class MeshProgram {
  private readonly program_;
  private readonly nearness_;
  private readonly part_;
  private readonly most_;
  private readonly array_;
  private readonly points_;
  private readonly triangles_;
  private cells_ = '';
  private count_ = 0;

  constructor(private readonly gl_: WebGL2RenderingContext) {
    const gl = gl_;
    this.program_ = linked_program(gl, 'mesh', vertex_source, fragment_source);
    this.nearness_ = gl.getUniformLocation(this.program_, 'nearness');
    this.part_ = gl.getUniformLocation(this.program_, 'part');
    this.most_ = gl.getUniformLocation(this.program_, 'most');
    this.array_ = gl.createVertexArray();
    this.points_ = gl.createBuffer();
    this.triangles_ = gl.createBuffer();
    gl.bindVertexArray(this.array_);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points_);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.triangles_);
    const bytes = point_size * 4;
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 4, gl.FLOAT, false, bytes, 0);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 2, gl.FLOAT, false, bytes, 16);
    gl.bindVertexArray(null);
  }

  /** False: it went with its context. */
  get lives(): boolean {
    return this.gl_.isProgram(this.program_);
  }

  /** The depth buffer is clear. */
  draw(
    { columns, rows, nearest }: Pick<Depths, 'columns' | 'rows' | 'nearest'>,
    points: Float32Array,
    { half, middle, most }: TexturePart = all_of_it,
  ): void {
    const gl = this.gl_;
    gl.useProgram(this.program_);
    gl.uniform4f(this.part_, ...half, ...middle);
    gl.uniform2f(this.most_, ...most);
    gl.bindVertexArray(this.array_);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points_);
    gl.bufferData(gl.ARRAY_BUFFER, points, gl.STREAM_DRAW);
    const cells = `${columns}x${rows}`;
    if (this.cells_ !== cells) {
      const triangles = mesh_triangles(columns, rows);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, triangles, gl.STATIC_DRAW);
      this.cells_ = cells;
      this.count_ = triangles.length;
    }
    gl.uniform1f(this.nearness_, nearest > 0 ? (2 * near_share) / nearest : 0);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.drawElements(gl.TRIANGLES, this.count_, gl.UNSIGNED_SHORT, 0);
    gl.disable(gl.DEPTH_TEST);
    gl.bindVertexArray(null);
  }
}

const programs = new WeakMap<WebGL2RenderingContext, MeshProgram>();

/** The picture on its mesh, as the view sees it: what is near covers what is far. */
export function depth_surface(
  depths: Depths,
  picture: Eye,
  view: Eye,
  aspect: number,
  view_aspect: number,
): Surface {
  const points = mesh_points(depths, picture, view, aspect, view_aspect);
  return {
    draw: (gl) => {
      let program = programs.get(gl);
      if (!program?.lives) programs.set(gl, (program = new MeshProgram(gl)));
      gl.clear(gl.DEPTH_BUFFER_BIT | gl.COLOR_BUFFER_BIT);
      program.draw(depths, points);
    },
  };
}
