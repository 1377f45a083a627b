import { deflateRawSync } from 'node:zlib';
import { describe, expect, it } from 'vitest';
import { identity } from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import {
  depth_surface,
  mesh_points,
  mesh_triangles,
  unpack_depths,
  type DepthFields,
} from '#client/present/depth_mesh';
import { warp_matrix } from '#client/present/warp';
import golden from '../support/warp_golden.json';

const { mesh } = golden;
const codes = Uint8Array.from(mesh.codes.match(/../g)!, (byte) => parseInt(byte, 16));
const grid = (change: Partial<DepthFields> = {}): DepthFields => ({
  depthColumns: mesh.columns,
  depthRows: mesh.rows,
  depthScale: mesh.scale,
  depthCodes: codes,
  ...change,
});

describe('the depths of a picture', () => {
  // tests/server/encode/packed_depths_test.cpp unpacks the same bytes.
  it('are those that were packed', () => {
    const depths = unpack_depths(grid())!;
    const close = mesh.inverse_depths.map((v): unknown => expect.closeTo(v, 6));
    expect([...depths.inverse_depths]).toEqual(close);
    expect(depths.distance).toBeCloseTo(mesh.median_distance, 4);
    expect(depths.nearest).toBeCloseTo(Math.max(...mesh.inverse_depths), 6);
  });

  it('are none where bytes are broken', () => {
    const broken: Partial<DepthFields>[] = [
      { depthCodes: codes.subarray(0, -1) },
      { depthCodes: new Uint8Array(0) },
      { depthCodes: Uint8Array.of(255, ...codes) },
      { depthCodes: deflateRawSync(new Uint8Array(16 << 20)) },
      { depthRows: mesh.rows - 1 },
      { depthRows: mesh.rows + 1 },
      { depthRows: 0 },
      { depthColumns: 0, depthRows: 0, depthScale: 0, depthCodes: new Uint8Array(0) }, // none was sent
      { depthColumns: 129, depthRows: 1, depthCodes: deflateRawSync(new Uint8Array(129)) },
      { depthScale: -1 },
      { depthScale: NaN },
      { depthScale: Infinity },
    ];
    for (const change of broken) expect(unpack_depths(grid(change))).toBeUndefined();
  });
});

describe('the mesh over a picture', () => {
  const eye: Eye = { position: [0, 0, 0], orientation: identity, fov_y_rad: 1 };

  // tests/load/display_test.cpp holds the mesh of catgs-load to the same numbers.
  it('is that of the shared numbers', () => {
    const points = mesh_points(
      unpack_depths(grid())!,
      mesh.picture as unknown as Eye,
      mesh.view as unknown as Eye,
      mesh.picture_aspect,
      mesh.view_aspect,
    );
    expect(points).toHaveLength(mesh.points.length * 6);
    for (const [i, point] of mesh.points.entries()) {
      const close = point.map((v): unknown => expect.closeTo(v, 4));
      expect([...points.subarray(6 * i, 6 * i + 3)]).toEqual(close);
    }
  });

  it('lies where the warp by one plane shows a plane', () => {
    const view: Eye = { ...eye, position: [0.4, -0.1, 0.5], fov_y_rad: 0.9 };
    const plane = { ...unpack_depths(grid())!, inverse_depths: new Float32Array(15).fill(0.25) };
    const points = mesh_points(plane, eye, view, 1.6, 1.6);
    const m = warp_matrix(view, eye, 1.6, 4);
    for (let i = 0; i < points.length; i += 6) {
      const [x, y, w, , u, v] = points.subarray(i, i + 6) as unknown as number[];
      const along = (row: number): number => m[row]! * u! + m[3 + row]! * v! + m[6 + row]!;
      expect(x! / w!).toBeCloseTo(along(0) / along(2), 4);
      expect(y! / w!).toBeCloseTo(along(1) / along(2), 4);
    }
  });

  it('has two triangles between each four points', () => {
    expect([...mesh_triangles(1, 1)].slice(0, 6)).toEqual([0, 1, 3, 1, 4, 3]);
    const triangles = mesh_triangles(64, 36);
    expect(triangles).toHaveLength(65 * 37 * 6);
    expect(Math.max(...triangles)).toBe(66 * 38 - 1);
  });

  it('is set up once for a context, and again when that was lost', () => {
    const calls: string[] = [];
    let lost = false;
    const values: Record<string, unknown> = { getProgramParameter: true };
    const gl = new Proxy({} as Record<string, unknown>, {
      get: (_, name) => (): unknown => {
        calls.push(String(name));
        return name === 'isProgram' ? !lost : (values[String(name)] ?? {});
      },
    }) as unknown as WebGL2RenderingContext;
    const surface = depth_surface(unpack_depths(grid())!, eye, eye, 1.6, 1.6);
    const programs = (): number => calls.filter((name) => name === 'createProgram').length;
    surface.draw(gl);
    surface.draw(gl);
    expect(programs()).toBe(1);
    lost = true;
    surface.draw(gl);
    expect(programs()).toBe(2);
    expect(calls.filter((name) => name === 'drawElements')).toHaveLength(3);
  });
});
