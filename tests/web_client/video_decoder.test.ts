import { create, type MessageInitShape } from '@bufbuild/protobuf';
import { beforeEach, describe, expect, it, vi } from 'vitest';
import type { EncodedFrame } from '#client/decode/picture';
import { WebCodecsDecoder } from '#client/decode/video_decoder';
import { Codec, FrameHeaderSchema, StreamConfigSchema, type StreamConfig } from '#client/wire/wire';

class FakeChunk {
  constructor(readonly init: EncodedVideoChunkInit) {}
}

/** The part of VideoDecoder that our decoder uses. It refuses chunks once it is closed. */
class FakeVideoDecoder {
  state = 'unconfigured';

  constructor(readonly init: VideoDecoderInit) {
    made.push(this);
  }

  configure(config: VideoDecoderConfig): void {
    this.state = 'configured';
    configured.push(`${config.codec} ${config.hardwareAcceleration}`);
  }

  decode(): void {
    if (this.state === 'closed') throw new DOMException('closed', 'InvalidStateError');
  }

  close(): void {
    this.state = 'closed';
  }

  /** Fails like browsers do: the decoder is closed before the error event. */
  fail(): void {
    this.close();
    this.init.error(new DOMException('broken', 'EncodingError'));
  }

  give(frame_id: number): { closed: boolean } {
    const picture = { timestamp: frame_id, closed: false, close: () => (picture.closed = true) };
    this.init.output(picture as unknown as VideoFrame);
    return picture;
  }
}

let made: FakeVideoDecoder[];
let configured: string[];
let decoded: bigint[];
let skipped: bigint[];
let failures: number;
let decoder: WebCodecsDecoder;

beforeEach(() => {
  vi.stubGlobal('VideoDecoder', FakeVideoDecoder);
  vi.stubGlobal('EncodedVideoChunk', FakeChunk);
  made = [];
  configured = [];
  decoded = [];
  skipped = [];
  failures = 0;
  decoder = new WebCodecsDecoder(
    create(StreamConfigSchema, { codec: Codec.H264, codecString: 'avc1.42C01F' }),
    'no-preference',
    () => 1,
    {
      decoded: (frame) => decoded.push(frame.header.frameId),
      skipped: (frame) => skipped.push(frame.header.frameId),
      failed: () => (failures += 1),
    },
  );
});

function browser_decoder(): FakeVideoDecoder {
  const [only] = made;
  if (!only || made.length !== 1) throw new Error('one decoder was expected');
  return only;
}

function decode(...ids: bigint[]): void {
  for (const id of ids) {
    const header = create(FrameHeaderSchema, { frameId: id, idr: id === 1n });
    const payload = new Uint8Array(1);
    const frame: EncodedFrame = { header, payload, received_us: 0, decoded_us: 0 };
    decoder.decode(frame);
  }
}

describe('every frame comes out once, decoded or skipped', () => {
  it('when a picture overtakes frames that gave none', () => {
    decode(1n, 2n, 3n);
    browser_decoder().give(2);
    expect(decoded).toEqual([2n]);
    expect(skipped).toEqual([1n]);
    decoder.close();
    expect(skipped).toEqual([1n, 3n]);
  });

  it('when the browser closes the decoder', () => {
    decode(1n, 2n);
    browser_decoder().fail();
    expect(failures).toBe(1);
    decode(3n); // comes before anybody has closed ours
    expect(failures).toBe(2);
    decoder.close();
    expect([...skipped].sort()).toEqual([1n, 2n, 3n]);
  });

  it('when it comes after close()', () => {
    decode(1n);
    decoder.close();
    decode(2n);
    expect(skipped).toEqual([1n, 2n]);
    decoder.close();
    expect(skipped).toEqual([1n, 2n]);
    expect(browser_decoder().give(1).closed).toBe(true);
    expect(decoded).toEqual([]);
  });
});

describe('another stream', () => {
  const stream = (change: MessageInitShape<typeof StreamConfigSchema>): StreamConfig =>
    create(StreamConfigSchema, { codec: Codec.H264, codecString: 'avc1.42C028', ...change });

  it('is taken by the same decoder, with the acceleration that it has', () => {
    decode(1n);
    expect(decoder.reconfigure(stream({}))).toBe(true);
    browser_decoder().give(1);
    expect(configured).toEqual(['avc1.42C01F no-preference', 'avc1.42C028 no-preference']);
    expect(decoded).toEqual([1n]);
  });

  it('is refused when it is of another codec or the decoder has failed', () => {
    expect(decoder.reconfigure(stream({ codec: Codec.MJPEG }))).toBe(false);
    browser_decoder().fail();
    expect(decoder.reconfigure(stream({}))).toBe(false);
    expect(configured).toHaveLength(1);
  });
});
