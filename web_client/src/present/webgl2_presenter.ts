import type { Picture } from '../decode/picture';
import { size_of, type Pixels, type Placing, type Presenter } from './presenter';
import type { Matrix3 } from './warp';

// One triangle covers the view. Places are -1…1, y down. The perspective division is done per pixel,
// because interpolated homogeneous coordinates stay exact.
const vertex_source = `#version 300 es
uniform mat3 picture_from_view;
out highp vec3 point;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0;
  point = picture_from_view * vec3(corner.x, -corner.y, 1.0);
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const fragment_source = `#version 300 es
precision mediump float;
uniform sampler2D picture;
in highp vec3 point;
out vec4 colour;
void main() {
  highp vec2 uv = 0.5 + 0.5 * point.xy / max(point.z, 1e-6);
  colour = vec4(texture(picture, uv).rgb, 1.0);
}`;

const unmoved: Matrix3 = new Float32Array([1, 0, 0, 0, 1, 0, 0, 0, 1]);

/** The upload of a VideoFrame converts its YUV to RGB by the colour space of its bitstream. */
export class WebGl2Presenter implements Presenter {
  readonly kind = 'webgl2';
  readonly can_warp = true;
  readonly most_px: number;
  private program_: WebGLProgram | null = null;
  private matrix_location_: WebGLUniformLocation | null = null;
  private placing_: Placing | undefined; // of the last drawing

  constructor(
    private readonly canvas_: OffscreenCanvas,
    private readonly gl_: WebGL2RenderingContext,
    emptied: () => void,
  ) {
    this.most_px = Number(gl_.getParameter(gl_.MAX_TEXTURE_SIZE)) || Infinity; // null: lost already
    this.set_up();
    // A lost context comes back empty. The canvas is an EventTarget in the worker, too.
    canvas_.addEventListener('webglcontextlost', (event) => event.preventDefault());
    canvas_.addEventListener('webglcontextrestored', () => {
      this.set_up();
      emptied();
    });
  }

  draw(picture: Picture, placing?: Placing): Promise<void> {
    const gl = this.gl_;
    const [width_px, height_px] = size_of(picture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
    this.redraw(placing ?? { matrix: unmoved, width_px, height_px });
    return Promise.resolve();
  }

  redraw(placing: Placing): void {
    const gl = this.gl_;
    const { matrix, surface, width_px, height_px } = placing;
    this.placing_ = placing;
    if (this.canvas_.width !== width_px || this.canvas_.height !== height_px) {
      this.canvas_.width = width_px;
      this.canvas_.height = height_px;
      gl.viewport(0, 0, width_px, height_px);
    }
    if (surface) return surface.draw(gl);
    gl.useProgram(this.program_);
    gl.uniformMatrix3fv(this.matrix_location_, false, matrix);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  read(): Pixels {
    const gl = this.gl_;
    const { width, height } = this.canvas_;
    // The browser discards the drawing buffer after it is shown, so the texture is drawn again.
    if (this.placing_) this.redraw(this.placing_);
    const bottom_up = new Uint8Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bottom_up);
    const rgba = new Uint8ClampedArray(bottom_up.length);
    const stride = width * 4;
    for (let row = 0; row < height; ++row) {
      const begin = (height - 1 - row) * stride;
      rgba.set(bottom_up.subarray(begin, begin + stride), row * stride);
    }
    return { width_px: width, height_px: height, rgba };
  }

  private set_up(): void {
    const gl = this.gl_;
    const program = gl.createProgram();
    for (const [type, source] of [
      [gl.VERTEX_SHADER, vertex_source],
      [gl.FRAGMENT_SHADER, fragment_source],
    ] as const) {
      const shader = gl.createShader(type);
      if (!shader) return; // only while the context is lost
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`presenter shader: ${gl.getProgramInfoLog(program) ?? ''}`);
    }
    this.program_ = program;
    this.matrix_location_ = gl.getUniformLocation(program, 'picture_from_view');
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) {
      gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    }
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
  }
}
