import { describe, expect, it } from 'vitest';
import {
  Codec,
  decode_server_message,
  encode_client_message,
  Error_Code,
  WireError,
  type ClientBody,
} from '#client/wire/wire';
import golden from '../support/wire_golden.json';

const bytes_of = (hex: string): ArrayBuffer => {
  const { buffer, byteOffset, byteLength } = Buffer.from(hex, 'hex');
  return buffer.slice(byteOffset, byteOffset + byteLength);
};

describe('client messages', () => {
  const settings = { widthPx: 640, heightPx: 360, maxFps: 30 };
  const decoders = [Codec.H264, Codec.MJPEG];
  const viewport = { viewportWidthPx: 640, viewportHeightPx: 360 };
  const position = { x: 1, y: -2.5, z: 0.125 };
  const worldFromCamera = { position, orientation: { x: 0, y: 0.6, z: 0, w: 0.8 } };
  const times = { receivedUs: 1000n, decodedUs: 2000n, presentedUs: 3000n, poseAgeUs: 2500 };

  it.each<[ClientBody, string]>([
    [
      {
        case: 'hello',
        value: { version: 1, sceneId: 'city', ...viewport, decoders, token: 'secret', settings },
      },
      golden.client_hello,
    ],
    [
      {
        case: 'pose',
        value: { poseId: 300n, clientTimeUs: 1234567890123n, worldFromCamera, fovYRad: 1 },
      },
      golden.client_pose,
    ],
    [{ case: 'ack', value: { frameId: 7n, ...times } }, golden.client_ack],
  ])('are encoded: $case', (body, hex) => {
    expect(Buffer.from(encode_client_message(body)).toString('hex')).toBe(hex);
  });
});

describe('server messages', () => {
  it('decodes an error', () => {
    const value = {
      code: Error_Code.SERVER_FULL,
      message: '8 of 8 sessions are in use',
      fatal: true,
    };
    const incoming = decode_server_message(bytes_of(golden.server_error));
    expect(incoming).toMatchObject({ kind: 'message', body: { case: 'error', value } });
  });

  it('decodes a stream configuration', () => {
    const incoming = decode_server_message(bytes_of(golden.server_config));
    expect(incoming).toMatchObject({
      kind: 'message',
      body: { case: 'config', value: { codecString: 'avc1.42C01F', widthPx: 1280, fps: 60 } },
    });
  });

  it('decodes a frame: header by its length, the rest is bitstream', () => {
    const incoming = decode_server_message(bytes_of(golden.server_frame));
    if (incoming.kind !== 'frame') throw new Error(`kind ${incoming.kind}`);
    expect(incoming.header).toMatchObject({
      frameId: 9n,
      poseId: 300n,
      poseClientTimeUs: 1234567890123n,
      idr: true,
      widthPx: 640,
      heightPx: 360,
      renderUs: 20000,
      sendWaitUs: 50,
    });
    expect([...incoming.payload]).toEqual([0, 0, 0, 1, 0x67, 0x42, 0xc0, 0x1f]);
  });

  it('ignores kinds of a newer server', () => {
    expect(decode_server_message(bytes_of('07aabb'))).toEqual({ kind: 'unknown' });
  });

  it.each([
    ['nothing', ''],
    ['a frame without length', '02'],
    ['a header longer than its message', '020508'],
    ['an endless length', '02ffffffffffff'],
    ['a broken header', '0202ffff'],
    ['a broken message', '01ffff'],
  ])('refuses %s', (_name, hex) => {
    expect(() => decode_server_message(bytes_of(hex))).toThrow(WireError);
  });
});
