/** CRC-32 of ISO 3309, four bits at a time. */
export function crc32(bytes: Uint8Array): number {
  const table = new Uint32Array(16);
  for (let k = 0; k < 16; ++k) {
    let rest = k;
    for (let bit = 0; bit < 4; ++bit) rest = rest & 1 ? (rest >>> 1) ^ 0xedb88320 : rest >>> 1;
    table[k] = rest;
  }
  let crc = 0xffffffff;
  for (const byte of bytes) {
    crc = (crc >>> 4) ^ table[(crc ^ byte) & 15]!;
    crc = (crc >>> 4) ^ table[(crc ^ (byte >>> 4)) & 15]!;
  }
  return ~crc >>> 0;
}
