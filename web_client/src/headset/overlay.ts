// Draws what the page adds to the scene inside a headset: signs, lines and shades. Places are in the room.
import { add, cross, normalize, right, scale, sub, type Vec3 } from '../base/vector';
import { linked_program } from '../present/depth_mesh';

export type Colour = readonly [red: number, green: number, blue: number, alpha: number];

/** Of words on signs: as in the page. */
export const font = (px: number, weight = 400): string =>
  `${weight} ${px}px ${getComputedStyle(document.body).fontFamily}`;

const vertex_floats = 9; // place, place in the texture, colour
const vertex_source = `#version 300 es
uniform mat4 projection;
uniform mat4 view;
layout(location = 0) in vec3 place;
layout(location = 1) in vec2 in_texture;
layout(location = 2) in vec4 in_colour;
out vec2 point;
out vec4 tint;
void main() {
  point = in_texture;
  tint = in_colour;
  gl_Position = projection * view * vec4(place, 1.0);
}`;

const fragment_source = `#version 300 es
precision mediump float;
uniform sampler2D picture;
in vec2 point;
in vec4 tint;
out vec4 colour;
void main() { colour = texture(picture, point) * tint; }`;

const unmoved = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
const clear_to = 0.55; // of half the view: there the shade at its border begins
const dark_from = 1.15;
const beyond = 4;
const corners = 40; // of circles

interface Batch {
  readonly texture: WebGLTexture;
  /** It lies before the eyes, not in the room. */
  readonly is_shade: boolean;
  readonly first: number;
  count: number;
}

/** A texture with a drawing that changes now and then. */
export class Sign {
  readonly texture: WebGLTexture;
  /** Of the drawing, px. */
  height_px = 0;
  private shown_ = '';

  constructor(
    private readonly gl_: WebGL2RenderingContext,
    readonly width_px: number,
  ) {
    this.texture = gl_.createTexture();
    gl_.bindTexture(gl_.TEXTURE_2D, this.texture);
    for (const side of [gl_.TEXTURE_WRAP_S, gl_.TEXTURE_WRAP_T])
      gl_.texParameteri(gl_.TEXTURE_2D, side, gl_.CLAMP_TO_EDGE);
    gl_.texParameteri(gl_.TEXTURE_2D, gl_.TEXTURE_MIN_FILTER, gl_.LINEAR_MIPMAP_LINEAR);
  }

  /** Draws it again where `what` is not what it shows. */
  show(what: string, height_px: number, paint: (context: CanvasRenderingContext2D) => void): void {
    if (what === this.shown_) return;
    this.shown_ = what;
    this.height_px = height_px;
    const canvas = document.createElement('canvas');
    [canvas.width, canvas.height] = [this.width_px, height_px];
    const context = canvas.getContext('2d');
    if (!context) return;
    paint(context);
    const gl = this.gl_;
    gl.bindTexture(gl.TEXTURE_2D, this.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, canvas);
    gl.generateMipmap(gl.TEXTURE_2D);
  }

  delete(): void {
    this.gl_.deleteTexture(this.texture);
  }
}

/** A flat rectangle: from its middle to the middle of its right and of its lower side. */
export interface Plate {
  readonly middle: Vec3;
  readonly right: Vec3;
  readonly down: Vec3;
}

export class Overlay {
  private readonly program_: WebGLProgram;
  private readonly projection_: WebGLUniformLocation | null;
  private readonly view_: WebGLUniformLocation | null;
  private readonly array_: WebGLVertexArrayObject;
  private readonly buffer_: WebGLBuffer;
  private readonly white_: WebGLTexture;
  private vertices_: number[] = [];
  private batches_: Batch[] = [];

  constructor(private readonly gl_: WebGL2RenderingContext) {
    const gl = gl_;
    this.program_ = linked_program(gl, 'overlay', vertex_source, fragment_source);
    this.projection_ = gl.getUniformLocation(this.program_, 'projection');
    this.view_ = gl.getUniformLocation(this.program_, 'view');
    this.array_ = gl.createVertexArray();
    this.buffer_ = gl.createBuffer();
    gl.bindVertexArray(this.array_);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer_);
    for (const [location, size, begin] of [
      [0, 3, 0],
      [1, 2, 3],
      [2, 4, 5],
    ] as const) {
      gl.enableVertexAttribArray(location);
      gl.vertexAttribPointer(location, size, gl.FLOAT, false, vertex_floats * 4, begin * 4);
    }
    gl.bindVertexArray(null);
    this.white_ = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, this.white_);
    const pixel = Uint8Array.of(255, 255, 255, 255);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  }

  /** Begins another picture. */
  clear(): void {
    this.vertices_ = [];
    this.batches_ = [];
  }

  sign({ texture }: Sign, { middle, right: across, down }: Plate, alpha = 1): void {
    const corner = (x: number, y: number): Vec3 =>
      add(middle, add(scale(across, x), scale(down, y)));
    const tint: Colour = [1, 1, 1, alpha];
    this.triangles(
      texture,
      [
        [-1, -1],
        [1, -1],
        [-1, 1],
        [1, -1],
        [1, 1],
        [-1, 1],
      ].map(([x, y]) => [corner(x!, y!), [(1 + x!) / 2, (1 + y!) / 2], tint]),
    );
  }

  /** A line that turns its side to `eye`. */
  line(points: readonly Vec3[], width: number, eye: Vec3, from: Colour, to = from): void {
    const strip = points.map((point, i) => {
      const along = sub(points[i + 1] ?? point, points[i === 0 ? 0 : i - 1]!);
      const aside = scale(normalize(cross(along, sub(eye, point)), right), width / 2);
      const share = i / Math.max(1, points.length - 1);
      const colour = from.map((v, k) => v + (to[k]! - v) * share) as unknown as Colour;
      return { a: add(point, aside), b: sub(point, aside), colour };
    });
    const none = [0, 0] as const;
    for (let i = 1; i < strip.length; ++i) {
      const [p, q] = [strip[i - 1]!, strip[i]!];
      this.triangles(this.white_, [
        [p.a, none, p.colour],
        [p.b, none, p.colour],
        [q.a, none, q.colour],
        [p.b, none, p.colour],
        [q.b, none, q.colour],
        [q.a, none, q.colour],
      ]);
    }
  }

  /** A flat ring between two radii. `x`, `y`: unit vectors in its plane. */
  ring(middle: Vec3, x: Vec3, y: Vec3, inner: number, outer: number, colour: Colour): void {
    const at = (i: number, radius: number): Vec3 => {
      const angle = (2 * Math.PI * i) / corners;
      const towards = add(scale(x, Math.cos(angle)), scale(y, Math.sin(angle)));
      return add(middle, scale(towards, radius));
    };
    const none = [0, 0] as const;
    for (let i = 0; i < corners; ++i)
      this.triangles(
        this.white_,
        [
          at(i, inner),
          at(i, outer),
          at(i + 1, inner),
          at(i, outer),
          at(i + 1, outer),
          at(i + 1, inner),
        ].map((point) => [point, none, colour]),
      );
  }

  /** Darkens the border of the view by `border`, and all of it by `all`, each 0…1. */
  shade(border: number, all: number): void {
    if (border === 0 && all === 0) return;
    const none = [0, 0] as const;
    const rings = [
      [0, all],
      [clear_to, all],
      [dark_from, Math.max(border, all)],
      [beyond, Math.max(border, all)],
    ] as const;
    for (let r = 1; r < rings.length; ++r)
      for (let i = 0; i < corners; ++i) {
        const corner = (k: number, ring: readonly [number, number]) => {
          const angle = (2 * Math.PI * (i + k)) / corners;
          const place: Vec3 = [ring[0] * Math.cos(angle), ring[0] * Math.sin(angle), 0];
          return [place, none, [0, 0, 0, ring[1]] as Colour] as const;
        };
        const [inner, outer] = [rings[r - 1]!, rings[r]!];
        this.triangles(
          this.white_,
          [
            corner(0, inner),
            corner(0, outer),
            corner(1, inner),
            corner(0, outer),
            corner(1, outer),
            corner(1, inner),
          ],
          true,
        );
      }
  }

  /** Call it once when all is there. */
  upload(): void {
    const gl = this.gl_;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffer_);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(this.vertices_), gl.STREAM_DRAW);
  }

  /** Into the viewport of an eye; both matrices are WebXR's. */
  draw(projection: Float32Array, view: Float32Array): void {
    const gl = this.gl_;
    gl.useProgram(this.program_);
    gl.bindVertexArray(this.array_);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE);
    // The middle of a shade is where the axis of the eye is.
    const around_axis = unmoved.slice();
    [around_axis[12], around_axis[13]] = [-projection[8]!, -projection[9]!];
    let set_for: boolean | undefined;
    for (const { texture, first, count, is_shade } of this.batches_) {
      if (set_for !== is_shade) {
        gl.uniformMatrix4fv(this.projection_, false, is_shade ? around_axis : projection);
        gl.uniformMatrix4fv(this.view_, false, is_shade ? unmoved : view);
        set_for = is_shade;
      }
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.drawArrays(gl.TRIANGLES, first, count);
    }
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
  }

  private triangles(
    texture: WebGLTexture,
    points: readonly (readonly [place: Vec3, point: readonly number[], colour: Colour])[],
    is_shade = false,
  ): void {
    const first = this.vertices_.length / vertex_floats;
    // WebXR has y up and looks along -z.
    for (const [[x, y, z], [u, v], colour] of points)
      this.vertices_.push(x, -y, -z, u!, v!, ...colour);
    const last = this.batches_[this.batches_.length - 1];
    if (last?.texture === texture && last.is_shade === is_shade) last.count += points.length;
    else this.batches_.push({ texture, is_shade, first, count: points.length });
  }
}
