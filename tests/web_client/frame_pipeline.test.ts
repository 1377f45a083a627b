import { create, type MessageInitShape } from '@bufbuild/protobuf';
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { FramePipeline } from '#client/decode/frame_pipeline';
import { Latest } from '#client/decode/latest';
import type { Decoder, DecoderEvents, EncodedFrame, Picture } from '#client/decode/picture';
import { Codec, FrameHeaderSchema, StreamConfigSchema, type AckInit } from '#client/wire/wire';
import { FakeTime } from './fakes';

interface FakePicture {
  id: bigint;
  closed: boolean;
}

class FakeDecoder implements Decoder {
  readonly frames: EncodedFrame[] = [];
  closed = false;

  constructor(readonly events: DecoderEvents) {}

  decode(frame: EncodedFrame): void {
    this.frames.push(frame);
    if (frame.header.frameId === fails_at) this.events.failed(new Error('broken'));
  }

  reconfigure(): boolean {
    return goes_on;
  }

  close(): void {
    this.closed = true;
    for (const frame of this.frames.splice(0)) {
      if (frame.decoded_us === 0) this.events.skipped(frame);
    }
  }
}

let now_us: number;
let time: FakeTime;
let decoders: FakeDecoder[];
let failures_seen: number[];
let has_decoder: boolean;
let goes_on: boolean; // decoders take another stream
let make: (made: Decoder | undefined) => Promise<Decoder | undefined>;
let draw: () => Promise<number | undefined>;
let fails_at: bigint | undefined; // the frame on which decoders fail at once
let refresh: (() => void)[];
let drawn: FakePicture[];
let pictures: FakePicture[];
let acks: AckInit[];
let dropped: bigint[];
let key_frames_wanted: number;
let undecodable: string[];
let pipeline: FramePipeline;

beforeEach(() => {
  now_us = 1000;
  time = new FakeTime();
  vi.spyOn(console, 'warn').mockImplementation(() => undefined);
  make = (made) => Promise.resolve(made);
  draw = () => Promise.resolve(undefined);
  decoders = [];
  failures_seen = [];
  has_decoder = true;
  goes_on = false;
  fails_at = undefined;
  refresh = [];
  drawn = [];
  pictures = [];
  acks = [];
  dropped = [];
  key_frames_wanted = 0;
  undecodable = [];
  pipeline = new FramePipeline(
    {
      now_us: () => now_us,
      timers: time,
      make_decoder: (_config, failures, events) => {
        failures_seen.push(failures);
        if (!has_decoder) return make(undefined);
        const decoder = new FakeDecoder(events);
        decoders.push(decoder);
        return make(decoder);
      },
      on_refresh: (draw) => refresh.push(draw),
      draw: (picture) => {
        drawn.push(picture as unknown as FakePicture);
        return draw();
      },
    },
    {
      ack: (ack) => acks.push(ack),
      presented: () => undefined,
      dropped: (frame) => dropped.push(frame.header.frameId),
      key_frame_wanted: () => (key_frames_wanted += 1),
      undecodable: (message) => undecodable.push(message),
    },
  );
});

afterEach(() => void vi.restoreAllMocks());

const settle = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, 0));

async function configure(): Promise<FakeDecoder> {
  pipeline.configure(create(StreamConfigSchema, { codec: Codec.H264, codecString: 'avc1.42C01F' }));
  await settle();
  return decoder();
}

function decoder(): FakeDecoder {
  const newest = decoders[decoders.length - 1];
  if (!newest) throw new Error('no decoder was made');
  return newest;
}

function push(id: bigint, change: MessageInitShape<typeof FrameHeaderSchema> = {}): void {
  const header = create(FrameHeaderSchema, { frameId: id, idr: id === 1n, ...change });
  pipeline.push(header, new Uint8Array(4));
}

function decode(from: FakeDecoder, id: bigint): FakePicture {
  const frame = from.frames.find(({ header }) => header.frameId === id);
  if (!frame) throw new Error(`frame ${id} is not in the decoder`);
  const picture = { id, closed: false, close: () => (picture.closed = true) };
  pictures.push(picture);
  frame.decoded_us = now_us;
  from.events.decoded(frame, picture as unknown as Picture);
  return picture;
}

async function display(): Promise<void> {
  for (const draw of refresh.splice(0)) draw();
  await settle();
}

describe('newest frame wins', () => {
  it('draws the last of several pictures per refresh, closes all, acknowledges each', async () => {
    const made = await configure();
    for (const id of [1n, 2n, 3n]) push(id);
    for (const id of [1n, 2n, 3n]) decode(made, id);
    now_us = 5000;
    expect(refresh).toHaveLength(1);
    await display();
    expect(drawn.map(({ id }) => id)).toEqual([3n]);
    expect(pictures.map(({ closed }) => closed)).toEqual([true, true, true]);
    expect(dropped).toEqual([1n, 2n]);
    expect(acks).toMatchObject([
      { frameId: 1n, dropped: true, presentedUs: 0n },
      { frameId: 2n, dropped: true, presentedUs: 0n },
      { frameId: 3n, dropped: false, presentedUs: 5000n, receivedUs: 1000n, decodedUs: 1000n },
    ]);
  });

  it('reports the age of the pose that it shows', async () => {
    const made = await configure();
    now_us = 40_000;
    push(1n, { poseClientTimeUs: 10_000n });
    decode(made, 1n);
    now_us = 70_000;
    await display();
    expect(acks).toMatchObject([{ poseAgeUs: 60_000 }]);
  });

  it('says when a visitor sees a picture that a headset shows later, if ever', async () => {
    const made = await configure();
    push(1n, { poseClientTimeUs: 10_000n });
    decode(made, 1n);
    draw = () => Promise.resolve(90_000);
    now_us = 70_000;
    await display();
    push(2n);
    decode(made, 2n);
    draw = () => Promise.resolve(0); // never
    await display();
    expect(acks).toMatchObject([{ presentedUs: 90_000n, poseAgeUs: 80_000 }, { dropped: true }]);
  });

  it('drops what a hidden page will not draw', async () => {
    const made = await configure();
    push(1n);
    const picture = decode(made, 1n);
    pipeline.hidden = true;
    await display();
    expect(picture.closed).toBe(true);
    expect(drawn).toEqual([]);
    expect(acks).toMatchObject([{ frameId: 1n, dropped: true }]);
  });
});

describe('key frames', () => {
  it('are where decoding begins', async () => {
    const made = await configure();
    push(5n);
    push(6n, { idr: true });
    push(7n);
    expect(made.frames.map(({ header }) => header.frameId)).toEqual([6n, 7n]);
    expect(acks).toMatchObject([{ frameId: 5n, dropped: true }]);
  });

  it('wait for the decoder to be made', async () => {
    pipeline.configure(create(StreamConfigSchema, { codec: Codec.H264 }));
    push(1n);
    push(2n);
    await settle();
    expect(decoder().frames.map(({ header }) => header.frameId)).toEqual([1n, 2n]);
  });

  it('are asked for again when too many frames wait', async () => {
    pipeline.configure(create(StreamConfigSchema, { codec: Codec.H264 }));
    for (let id = 1n; id <= 9n; ++id) push(id);
    expect(key_frames_wanted).toBe(1);
    await settle();
    expect(decoder().frames).toEqual([]);
    expect(acks).toHaveLength(9);
    push(20n, { idr: true });
    expect(decoder().frames).toHaveLength(1);
  });
});

describe('another stream', () => {
  it('goes to the decoder that there is, which gives what it still holds', async () => {
    goes_on = true;
    const made = await configure();
    push(1n);
    await configure();
    push(2n); // belongs to neither stream: the new one begins with a key frame
    push(3n, { idr: true });
    expect(decoders).toEqual([made]);
    expect(made.frames.map(({ header }) => header.frameId)).toEqual([1n, 3n]);
    decode(made, 1n);
    await display();
    expect(drawn.map(({ id }) => id)).toEqual([1n]);
    expect(dropped).toEqual([2n]);
  });

  it('gets another decoder where that one cannot go on', async () => {
    const first = await configure();
    push(1n);
    const second = await configure();
    expect(second).not.toBe(first);
    expect(first.closed).toBe(true);
    expect(dropped).toEqual([1n]);
  });

  it('counts no single failure of the former, but what cost a rung', async () => {
    goes_on = true;
    const fail = async (): Promise<void> => {
      decoder().events.failed(new Error('broken'));
      await settle();
    };
    await configure();
    for (let i = 0; i < 3; ++i) await fail();
    await configure();
    await fail();
    expect(failures_seen).toEqual([0, 1, 2, 3, 3]);
  });
});

describe('the end of a stream', () => {
  it('acknowledges everything that is inside, and nothing later', async () => {
    const made = await configure();
    for (const id of [1n, 2n, 3n]) push(id);
    decode(made, 1n);
    pipeline.end_stream();
    expect([...dropped].sort()).toEqual([1n, 2n, 3n]);
    await display();
    expect(drawn).toEqual([]);
    expect(acks).toHaveLength(3);
  });
});

describe('failures', () => {
  it('renew the decoder and ask for a key frame', async () => {
    const first = await configure();
    push(1n);
    first.events.failed(new Error('broken'));
    await settle();
    expect(first.closed).toBe(true);
    expect(dropped).toEqual([1n]);
    expect(decoders).toHaveLength(2);
    expect(key_frames_wanted).toBe(1);
    expect(failures_seen).toEqual([0, 1]);
    push(2n);
    push(3n, { idr: true });
    expect(decoder().frames.map(({ header }) => header.frameId)).toEqual([3n]);
  });

  it('on the first of several waiting frames leave none of them unacknowledged', async () => {
    fails_at = 1n;
    pipeline.configure(create(StreamConfigSchema, { codec: Codec.H264 }));
    for (const id of [1n, 2n, 3n]) push(id);
    await settle();
    expect([...dropped].sort()).toEqual([1n, 2n, 3n]);
    expect(acks).toHaveLength(3);
    expect(decoders.map(({ closed }) => closed)).toEqual([true, false]);
    expect(decoders.flatMap(({ frames }) => frames)).toEqual([]);
    expect(key_frames_wanted).toBe(1);
  });

  it('close pictures that an old decoder still gives', async () => {
    const first = await configure();
    push(1n);
    push(2n);
    const inside = [...first.frames];
    first.events.failed(new Error('broken'));
    first.frames.push(...inside);
    const late = decode(first, 1n);
    expect(late.closed).toBe(true);
    expect(refresh).toEqual([]);
  });

  it('end with a word when no decoder is left', async () => {
    has_decoder = false;
    pipeline.configure(create(StreamConfigSchema, { codec: Codec.H264, codecString: 'avc1.64' }));
    await settle();
    expect(undecodable).toEqual(['no decoder for avc1.64']);
  });

  it('of a former stream do not count against the next', async () => {
    const first = await configure();
    first.events.failed(new Error('broken'));
    await settle();
    await configure();
    expect(failures_seen).toEqual([0, 1, 0]);
  });
});

describe('a step that does not end', () => {
  const never = (): Promise<never> => new Promise(() => undefined);
  const seconds = async (count: number): Promise<void> => {
    for (let i = 0; i < count; ++i) {
      time.advance(1000);
      await settle();
    }
  };

  it('of a decoder that gives neither picture nor error is a failure', async () => {
    const first = await configure();
    push(1n);
    await seconds(2);
    decode(first, 1n);
    push(2n);
    await seconds(2);
    expect(decoders).toEqual([first]); // each picture is a sign of life
    await seconds(1);
    expect(first.closed).toBe(true);
    expect(decoders).toHaveLength(2);
    expect([failures_seen, key_frames_wanted, dropped]).toEqual([[0, 1], 1, [2n]]);
    await seconds(20); // nothing is inside: nothing is late
    expect(decoders).toHaveLength(2);
  });

  it('is none that a machine slept through', async () => {
    const first = await configure();
    push(1n);
    time.sleep(3_600_000);
    await seconds(1);
    expect(decoders).toEqual([first]);
  });

  it('of a decoder that is never made is a failure, and a late one is closed', async () => {
    let late = (): void => undefined;
    make = (made) => new Promise((resolve) => (late = () => resolve(made)));
    await configure();
    make = (made) => Promise.resolve(made);
    await seconds(3);
    expect(failures_seen).toEqual([0, 1]);
    late();
    await settle();
    expect(decoders.map(({ closed }) => closed)).toEqual([true, false]);
  });

  it('of a decoder that cannot be made is a failure', async () => {
    make = () => Promise.reject(new Error('not supported'));
    pipeline.configure(create(StreamConfigSchema, { codec: Codec.H264, codecString: 'avc1.64' }));
    make = (made) => Promise.resolve(made);
    await settle();
    expect(failures_seen).toEqual([0, 1]);
  });

  it.each([
    ['never ends', never],
    ['fails', () => Promise.reject(new Error('lost'))],
  ])('of drawing, which %s, frees the canvas and is a failure', async (_name, drawing) => {
    draw = drawing;
    const first = await configure();
    push(1n);
    const picture = decode(first, 1n);
    await display();
    await seconds(3);
    expect(picture.closed).toBe(true);
    expect([failures_seen, dropped]).toEqual([[0, 1], [1n]]);
    draw = () => Promise.resolve(undefined);
    push(2n, { idr: true });
    decode(decoder(), 2n);
    await display();
    expect(acks.at(-1)).toMatchObject({ frameId: 2n, dropped: false });
  });
});

describe('a decoder that the browser takes back', () => {
  const taken_back = new DOMException('reclaimed', 'QuotaExceededError');

  it('costs no rung once it has worked, and one that never did counts', async () => {
    const first = await configure();
    push(1n);
    decode(first, 1n);
    first.events.failed(taken_back);
    await settle();
    decoder().events.failed(taken_back);
    await settle();
    expect(failures_seen).toEqual([0, 0, 1]);
  });

  it('from a hidden page is made again when somebody looks, and no failure', async () => {
    const first = await configure();
    push(1n);
    pipeline.hidden = true;
    time.advance(60_000); // a hidden page decodes when it may
    first.events.failed(new DOMException('closed', 'OperationError'));
    push(2n, { idr: true });
    await configure(); // a reconnect
    expect([decoders, key_frames_wanted]).toEqual([[first], 0]);
    expect([...dropped].sort()).toEqual([1n, 2n]);
    pipeline.hidden = false;
    await settle();
    expect([failures_seen, key_frames_wanted]).toEqual([[0, 0], 1]);
    push(3n, { idr: true });
    decode(decoder(), 3n);
    await display();
    expect(drawn.map(({ id }) => id)).toEqual([3n]);
  });
});

describe('Latest', () => {
  it('holds one value and hands out each exactly once', () => {
    const discarded: number[] = [];
    const latest = new Latest<number>((old) => discarded.push(old));
    latest.put(1);
    latest.put(2);
    expect(latest.take()).toBe(2);
    expect(latest.take()).toBeUndefined();
    latest.put(3);
    latest.clear();
    expect(discarded).toEqual([1, 3]);
  });
});
