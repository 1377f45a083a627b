// Scenes and camera paths that tests write for themselves.
import { cpSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import path from 'node:path';
import type { Vec3 } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { clean_up } from './clean_up';
import { source_dir } from './paths';
import { catgs_render } from './programs';

/** Makes a folder for the tests of a file. */
export function scratch_folder(): string {
  const folder = mkdtempSync(path.join(tmpdir(), 'catgs-e2e-'));
  clean_up(() => rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/** Makes the demo city and garden with their tours, as deploy/run.sh does. Returns the city's file. */
export function make_demo(folder: string): string {
  const file = (name: string): string => path.join(folder, name);
  catgs_render('synth', 'city', file('city.ply'), '--gaussians', '300000', '--seed', '1');
  catgs_render('synth', 'garden', file('garden.ply'), '--gaussians', '150000', '--seed', '1');
  for (const name of ['city.json', 'city.media', 'garden.json'])
    cpSync(path.join(source_dir, 'deploy', 'demo', name), file(name), { recursive: true });
  return file('city.ply');
}

/** Cuts the streets around a point out of the city, because floors takes as long as the area is large. */
export function crop_streets(city: string, file: string, x: number, z: number): void {
  const box = [x - 24, -60, z - 33, x + 24, 2, z + 33];
  catgs_render('convert', city, file, `--crop=${box.join()}`);
}

/** Makes streets of the demo city with one tour, with y down and the ground at 0. Returns their file. */
export function make_streets(folder: string, title: string, stops: readonly object[]): string {
  const city = path.join(scratch_folder(), 'whole.ply');
  const streets = path.join(folder, 'city.ply');
  catgs_render('synth', 'city', city, '--gaussians', '300000');
  crop_streets(city, streets, 0, 3);
  const sidecar = {
    up: [0, -1, 0],
    metres_per_unit: 1,
    start_pose: { position: [0, -9, -12], look_at: [0, -1, 20] },
    tours: [{ title, stops }],
  };
  writeFileSync(path.join(folder, 'city.json'), JSON.stringify(sidecar));
  return streets;
}

export interface Sidecar {
  readonly focus: Vec3;
  readonly start_pose: Pose;
}

/** Adds tours to the sidecar of a scene. */
export function write_tours(file: string, make: (sidecar: Sidecar) => readonly object[]): void {
  const sidecar = JSON.parse(readFileSync(file, 'utf8')) as Sidecar;
  writeFileSync(file, JSON.stringify({ ...sidecar, tours: make(sidecar) }));
}

/** `timestamp tx ty tz qx qy qz qw`, one line per pose. */
export function write_tum(file: string, poses: readonly Pose[]): void {
  const lines = poses.map(({ position, orientation }, i) =>
    [i, ...position, ...orientation].join(' '),
  );
  writeFileSync(file, `${lines.join('\n')}\n`);
}

export interface Patch {
  readonly rgb: readonly [number, number, number]; // 0…255
  /** Centre in the plane that the camera at the origin looks at, in units of its distance. */
  readonly x: number;
  readonly y: number;
}

const sh_c0 = 0.28209479177387814; // value of the constant basis function
// Three Gaussians of 90 % let 0.1 % through. A fourth would end the pixel, because its transmittance is too low.
const layers = 3;
const opacity_logit = Math.log(0.9 / 0.1);
const properties = [
  ...['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity'],
  ...['scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'],
];

/**
 * A trained-scene .ply with one flat, opaque, round spot per patch at distance `z`, of standard
 * deviation `sigma` (in units of the distance).
 */
export function write_patches(
  file: string,
  patches: readonly Patch[],
  z: number,
  sigma: number,
): void {
  const rows = patches.flatMap(({ rgb, x, y }) =>
    Array.from({ length: layers }, (_, layer) => {
      const depth = z + layer * 0.01;
      const dc = rgb.map((value) => (value / 255 - 0.5) / sh_c0);
      const scale = Math.log(sigma * z);
      return [
        x * depth,
        y * depth,
        depth,
        ...dc,
        opacity_logit,
        scale,
        scale,
        Math.log(1e-3),
        1,
        0,
        0,
        0,
      ];
    }),
  );
  write_rows(file, rows);
}

/** A closed room of 8 x 2.6 x 6 m around x = z = 0, with its floor at y = 0 and y down, of opaque balls. */
export function write_room(file: string): void {
  const [x1, y1, z1] = [4, 2.6, 3];
  const apart = 0.1;
  const rows: number[][] = [];
  const plate = (corner: Vec3, u: Vec3, v: Vec3, grey: number): void => {
    const [columns, lines] = [u, v].map((side) => Math.round(Math.hypot(...side) / apart)) as [
      number,
      number,
    ];
    for (let a = 0; a <= columns; ++a)
      for (let b = 0; b <= lines; ++b) {
        const shade = (a >> 3) % 2 === (b >> 3) % 2 ? grey : -grey;
        const at = corner.map((c, k) => c + (u[k]! * a) / columns + (v[k]! * b) / lines);
        const size = Array<number>(3).fill(Math.log(0.05));
        rows.push([...at, shade, grey, -shade, opacity_logit, ...size, 1, 0, 0, 0]);
      }
  };
  for (const y of [0, -y1]) plate([-x1, y, -z1], [2 * x1, 0, 0], [0, 0, 2 * z1], 0.4);
  for (const x of [-x1, x1]) plate([x, 0, -z1], [0, -y1, 0], [0, 0, 2 * z1], 0.8);
  for (const z of [-z1, z1]) plate([-x1, 0, z], [0, -y1, 0], [2 * x1, 0, 0], 1.2);
  write_rows(file, rows);
}

/** A .ply with the values of `properties`. */
function write_rows(file: string, rows: readonly (readonly number[])[]): void {
  const header = [
    'ply',
    'format binary_little_endian 1.0',
    `element vertex ${rows.length}`,
    ...properties.map((name) => `property float ${name}`),
    'end_header\n',
  ].join('\n');
  writeFileSync(
    file,
    Buffer.concat([Buffer.from(header), Buffer.from(Float32Array.from(rows.flat()).buffer)]),
  );
}
