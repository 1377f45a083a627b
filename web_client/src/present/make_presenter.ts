import { Canvas2dPresenter } from './canvas2d_presenter';
import type { Presenter } from './presenter';
import { WebGl2Presenter } from './webgl2_presenter';

/** WebGL2 where a GPU does it, a 2D canvas everywhere else. Throws when the browser has neither. */
export function make_presenter(canvas: OffscreenCanvas): Presenter {
  const gl = canvas.getContext('webgl2', {
    alpha: false,
    antialias: false,
    depth: false,
    failIfMajorPerformanceCaveat: true, // no WebGL in software
    powerPreference: 'low-power',
  });
  if (gl) return new WebGl2Presenter(canvas, gl);
  const context = canvas.getContext('2d', { alpha: false });
  if (context) return new Canvas2dPresenter(canvas, context);
  throw new Error('this browser offers neither WebGL2 nor a 2D canvas to a worker');
}
