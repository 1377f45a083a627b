import { Canvas2dPresenter } from './canvas2d_presenter';
import type { Presenter } from './presenter';
import { WebGl2Presenter } from './webgl2_presenter';

export type PresenterChoice = 'auto' | 'webgl2' | '2d';

/**
 * Makes a WebGL2 presenter where a GPU runs it and a 2D canvas elsewhere, or the `wanted` one. Throws
 * where the browser has neither. `emptied`: the GPU has lost the canvas, which needs another picture.
 */
export function make_presenter(
  canvas: OffscreenCanvas,
  wanted: PresenterChoice,
  emptied: () => void,
): Presenter {
  const attributes: WebGLContextAttributes = { alpha: false, antialias: false };
  if (wanted === 'webgl2' || (wanted === 'auto' && has_hardware_webgl2())) {
    const gl = canvas.getContext('webgl2', attributes);
    if (gl) return new WebGl2Presenter(canvas, gl, emptied);
  }
  const context = canvas.getContext('2d', { alpha: false });
  canvas.addEventListener('contextrestored', emptied);
  if (context) return new Canvas2dPresenter(canvas, context);
  throw new Error('this browser offers neither WebGL2 nor a 2D canvas to a worker');
}

/**
 * Asks a separate canvas, because a canvas gives contexts of one kind only.
 * failIfMajorPerformanceCaveat alone is not enough, because Chromium grants it to its software renderer.
 */
function has_hardware_webgl2(): boolean {
  const gl = new OffscreenCanvas(1, 1).getContext('webgl2', { failIfMajorPerformanceCaveat: true });
  if (!gl) return false;
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const renderer = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension('WEBGL_lose_context')?.loseContext();
  return !/swiftshader|llvmpipe|softpipe|software|basic render/i.test(renderer);
}
